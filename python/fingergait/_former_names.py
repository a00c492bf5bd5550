"""Modules by the names that they had before they moved into wings; programs rely on them."""

import sys

from fingergait.object import shapes
from fingergait.run import log, loss, metrics, pose_error, simulate
from fingergait.scenario import core_config, faults, reference
from fingergait.sim import gl, injection, plant, scene, sensors, start

_FORMER = {"config": core_config, "model": scene}
_SAME = (
    shapes,
    log,
    loss,
    metrics,
    pose_error,
    simulate,
    faults,
    reference,
    gl,
    injection,
    plant,
    sensors,
    start,
)

for _name, _module in [*_FORMER.items(), *((module.__name__.rpartition(".")[2], module) for module in _SAME)]:
    sys.modules.setdefault(f"fingergait.{_name}", _module)
