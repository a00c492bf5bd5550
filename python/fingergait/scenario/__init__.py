"""What a run is asked: scenario, reference, faults, and the core configuration that follows."""

from fingergait.scenario.scenario import (
    SIZES,
    Disturbance,
    Input,
    ReferenceConfig,
    Scenario,
    SensorConfig,
    parse_override,
)

__all__ = ["SIZES", "Disturbance", "Input", "ReferenceConfig", "Scenario", "SensorConfig", "parse_override"]
