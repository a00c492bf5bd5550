"""What the search finds: nominal grasps of an object, or the first constraint that forbids them."""

from dataclasses import asdict, dataclass
from typing import Any

import mujoco
import numpy as np
from numpy.typing import NDArray

from fingergait.adopt.family import ObjectSpec

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Grasp:
    """A nominal grasp, from which the object can be turned both ways.

    object
        What is held.
    kind
        "gait": any one finger can be spared, so that the object turns in the air without end. "regrasp": held with all
        fingers only; turning on needs a table to set the object down.
    joints
        Angles of each finger's driven joints, rad.
    pose
        Position (m) and wxyz quaternion of the object's frame in the hand model's world.
    places, normals
        Contacts and outward normals there, (n, 3) in the same world.
    stroke
        Turn (rad) that all fingers follow from here, both ways, with links and neighbours clear.
    reach
        (n, 2): how far each finger alone follows backwards and forwards, rad; `ended` says what ends it.
    load
        Load factor with all fingers: the share of the torque limits that the worst disturbance needs.
    spared
        The same with each finger away; infinite where the others can't hold at any torque.
    slack
        What the force QP leaves undelivered at the full torque limits with each finger away, in fifths of the weight.
    joint_margin
        Least distance of a joint from its limits at the grasp, as a share of its range.
    link_clearance, finger_gap, palm_clearance
        Least distances at the grasp, m.
    """

    object: ObjectSpec
    kind: str
    joints: tuple[tuple[float, ...], ...]
    pose: tuple[float, ...]
    places: Array
    normals: Array
    stroke: float
    reach: Array
    ended: tuple[tuple[str, str], ...]
    load: float
    spared: tuple[float, ...]
    slack: tuple[float, ...]
    joint_margin: float
    link_clearance: float
    finger_gap: float
    palm_clearance: float

    def scenario(self, hand_file: str, name: str | None = None) -> dict[str, Any]:
        """Values of a scenario (`Scenario.build`) that starts from this grasp with the hand in `hand_file`."""
        shape, turn = self.object.shape, np.empty(3)
        mujoco.mju_quat2Vel(turn, np.array(self.pose[3:]), 1.0)
        return {
            "name": name or f"{self.object.family}-{1e3 * self.object.radius:.0f}mm",
            "description": f"Grasp found for a {self.object}, {1e3 * self.object.mass:.0f} g.",
            "hand": {"file": hand_file},
            "object": {
                "shape": shape.kind,
                "size": list(shape.size),
                "mass": self.object.mass,
                "pose": [*self.pose[:3], *turn.tolist()],
            },
            "grasp": {"joints": [angle for finger in self.joints for angle in finger]},
        }

    @classmethod
    def from_json(cls, values: dict[str, Any]) -> "Grasp":
        """The grasp that `as_json` has made plain values of."""
        spec = ObjectSpec(values["object"]["family"], tuple(values["object"]["size"]), values["object"]["mass"])
        arrays = {key: np.array(values[key]) for key in ("places", "normals", "reach")}
        spared = tuple(np.inf if x is None else x for x in values["spared"])
        joints, ended = (tuple(map(tuple, values[key])) for key in ("joints", "ended"))
        tuples = {"pose": tuple(values["pose"]), "slack": tuple(values["slack"])}
        load = np.inf if values["load"] is None else values["load"]
        given = {"object": spec, "spared": spared, "joints": joints, "ended": ended, "load": load, **arrays, **tuples}
        return cls(**(values | given))

    def as_json(self) -> dict[str, Any]:
        """Plain values for a JSON file; infinite loads are null."""
        values = asdict(self)
        for key in ("places", "normals", "reach"):
            values[key] = np.asarray(values[key]).tolist()
        values["load"] = self.load if np.isfinite(self.load) else None
        values["spared"] = [x if np.isfinite(x) else None for x in self.spared]
        return values


@dataclass(frozen=True)
class Found:
    """What was found for one object: grasps, best first, all of one kind; `reason` why there is none that gaits."""

    object: ObjectSpec
    grasps: tuple[Grasp, ...]
    stage: str
    reason: str
    seconds: float

    @property
    def best(self) -> Grasp | None:
        """The grasp with the longest stroke."""
        return self.grasps[0] if self.grasps else None

    @property
    def kind(self) -> str:
        """ "gait", "regrasp" or "none"."""
        return self.grasps[0].kind if self.grasps else "none"
