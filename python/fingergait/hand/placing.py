"""Where a model stands, and a name for each of its parts."""

import mujoco
import numpy as np
from numpy.typing import NDArray

from fingergait.hand.chains import NAMELESS

Array = NDArray[np.float64]


def name_everything(spec: mujoco.MjSpec) -> None:
    """Gives what has no name one of ours, so that it can be found again after the model has changed."""
    for kind, items in (("joint", spec.joints), ("geom", spec.geoms), ("body", spec.bodies)):
        taken = {item.name for item in items}
        for number, item in enumerate(items):
            if not item.name and not (kind == "body" and item == spec.worldbody):
                name = f"{NAMELESS}{kind}_{number}"
                while name in taken:
                    name += "_"
                taken.add(name)
                item.name = name


def place(spec: mujoco.MjSpec, pose: tuple[float, ...]) -> None:
    """Moves the whole model to `pose` in the world, [x, y, z, rx, ry, rz], m and rotation vector."""
    world = spec.worldbody
    inside = [f for f in world.frames if f.frame is None]
    for kind in (world.bodies, world.geoms, world.sites, world.cameras, world.lights):
        inside += [element for element in kind if element.frame is None and element.parent == world]
    frame = world.add_frame(pos=list(pose[:3]), quat=quaternion_of(np.array(pose[3:])).tolist())
    for element in inside:
        element.set_frame(frame)


def quaternion_of(vector: Array) -> Array:
    """Quaternion wxyz of the rotation vector (3,)."""
    out, angle = np.array([1.0, 0.0, 0.0, 0.0]), float(np.linalg.norm(vector))
    if angle > 0.0:
        mujoco.mju_axisAngle2Quat(out, vector / angle, angle)
    return out
