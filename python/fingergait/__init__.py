"""Model-based finger gaits for multi-fingered hands: robust in-hand rotation of unknown objects, with a certificate."""

from typing import TYPE_CHECKING, Any

from fingergait.sim import gl as gl  # before anything that imports MuJoCo

# isort: split
from fingergait import _former_names as _former_names
from fingergait import synthesis
from fingergait._core import (
    ArtifactError,
    Command,
    ConfigError,
    Controller,
    Diagnostics,
    DualStagePlanner,
    FingergaitError,
    ForceOptimizer,
    ForceSolution,
    HandModel,
    LpSolution,
    Measurement,
    Reference,
    ShapeError,
    TorquePid,
    __version__,
    default_config,
    gait_lp,
)
from fingergait.hand import hand_json
from fingergait.run.log import Log
from fingergait.run.simulate import Run, simulate
from fingergait.scenario import Scenario
from fingergait.sim.plant import MujocoPlant, Plant

if TYPE_CHECKING:
    from fingergait.adopt.pipeline import adopt as adopt

__all__ = [
    "ArtifactError",
    "Command",
    "ConfigError",
    "Controller",
    "Diagnostics",
    "DualStagePlanner",
    "FingergaitError",
    "ForceOptimizer",
    "ForceSolution",
    "HandModel",
    "Log",
    "LpSolution",
    "Measurement",
    "MujocoPlant",
    "Plant",
    "Reference",
    "Run",
    "Scenario",
    "ShapeError",
    "TorquePid",
    "__version__",
    "adopt",
    "default_config",
    "gait_lp",
    "hand_json",
    "simulate",
    "synthesis",
]


def __getattr__(name: str) -> Any:
    if name == "adopt":  # what few need is not loaded by all
        import fingergait.adopt

        return fingergait.adopt
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
