"""What MuJoCo does: scene, plant, sensors, injected faults and the start of a run."""
