"""What a run is asked: scenario, reference, faults, and the core configuration that follows."""

from fingergait.scenario.scenario import SIZES, Disturbance, ReferenceConfig, Scenario, SensorConfig, parse_override

__all__ = ["SIZES", "Disturbance", "ReferenceConfig", "Scenario", "SensorConfig", "parse_override"]
