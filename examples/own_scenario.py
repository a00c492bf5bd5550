"""A scenario of one's own, built in Python: a heavy box that is pushed while it turns."""

import fingergait as fg

scenario = fg.Scenario.build(
    {
        "name": "pushed-box",
        "duration": 6.0,
        "object": {"shape": "box", "size": [0.022, 0.022, 0.06], "mass": 0.5},  # what the controller believes
        "truth": {"mass_scale": 1.3, "friction": 0.9, "com_offset": [0.0, 0.002, 0.0]},  # what is
        "reference": {"lift": 0.011, "yaw_rate": 0.2},
        "sensors": {"position_noise": 1e-4, "orientation_noise": 1e-3, "pose_rate_hz": 100.0, "pose_delay_s": 0.01},
        "disturbance": [{"at": 4.0, "duration": 0.2, "force": [3.0, 0.0, 0.0]}],
    }
)
run = fg.simulate(scenario)
print(f"held: {not run.metrics['dropped']}, recovery after the push: {run.metrics['recovery_time_s'][0]:.2f} s")

# The same with one key changed, as with `--set` on the command line.
harder = fg.simulate(scenario.replace({"disturbance.0.force": [6.0, 0.0, 0.0]}))
print(f"twice the push: {1e3 * harder.metrics['max_position_error_m']:.2f} mm at worst")

# What cannot be is refused in one line.
try:
    scenario.replace({"object.mass": -1.0})
except fg.ConfigError as error:
    print(f"refused: {error}")
