"""What happens now and why, in a line of plain words."""

import numpy as np

from fingergait.run.pose_error import pose_errors
from fingergait.view.pose import Pose

CAUSES = {
    "clock": "the measurement's time stands still or jumps",
    "late": "the step came late",
    "encoder": "a joint angle is not plausible",
    "encoder_stuck": "a joint angle stands still while its finger moves",
    "pose": "the measured pose is no pose",
    "pose_jump": "the measured pose jumped away from where the fingers say the object is",
    "pose_stale": "the measured pose stands still while the fingers say that the object moves",
    "tactile": "a tactile reading is not plausible",
    "tactile_lost": "a tactile sensor feels nothing although its finger presses",
    "tactile_stuck": "a tactile sensor reads what its finger can't explain",
    "reference": "the desired pose is out of reach",
    "contacts_lost": "no finger feels the object",
    "torque_box": "the fingers' own weight leaves no torque to choose",
    "solver": "no solver certifies the contact forces",
    "saturated": "torques have been at their limits for long",
    "torque_sensor": "a torque sensor gives no number",
    "motor": "a motor gives no torque",
    "finger_lost": "a finger has looked for the object for long",
    "overdue": "the grasp has grown bad and no finger can be spared to mend it",
    "pose_frame": "the measured pose is not where the fingers touch: it is in another frame",
    "tactile_scale": "the tactile forces contradict the joint torques",
    "tactile_axes": "the normals that the fingers feel point away from each other",
    "aground": "the object was set down and can't be taken again, or nothing was found below it to set it down on",
}
"""What each of the core's faults means, in the order of its bits."""
_MODES = {
    "hold": "the object is held where it is",
    "squeeze": "the fingers press harder and hold the object by what they feel",
    "damp": "a finger is let go, the others hold the object where it is",
    "stop": "the torques fade: nothing is held",
}


REGRASPING = {
    "brake": "the turn comes to rest: the object is to be set down for a new grasp",
    "lower": "the object goes down until it is felt to lie",
    "release": "the object lies: the fingers give up what they carry",
    "return": "the object lies: all fingers go back round it",
    "approach": "the fingers go in until each feels the object",
    "preload": "the fingers press the object that still lies",
    "check": "the fingers take the weight, to see whether the grasp holds",
    "lift": "the object is lifted again",
    "stand": "no support was found below the object: it is held in the air",
    "rest": "too many grasps have failed: the object is left where it lies",
}
"""What is done in each phase of setting down and taking again but the turn itself."""


def explain(pose: Pose, lost: str | None = None) -> str:
    """One or two sentences on a row.

    Parameters
    ----------
    pose
        The row with its kinematics.
    lost
        How the object was lost, if it was.
    """
    if lost is not None:
        return f"The object is lost: {lost}. Reset begins anew."
    if pose.row.t < 0.0:
        return "The fingers have just closed: the controller holds the object where it is."
    mode = pose.safe_mode
    if mode != "normal":
        causes = "; ".join(CAUSES[name] for name in pose.faults) or "it waits until all is well again"
        return f"{mode}: {_MODES[mode]}, because {causes}. {_others(pose, None)}"
    if pose.regrasp in REGRASPING:
        said = REGRASPING[pose.regrasp]
        return f"{said[0].upper()}{said[1:]}. {_others(pose, None)}"
    error = pose_errors(pose.row.group("object")[None], pose.row.group("desired")[None])[0]
    off = f"{1e3 * np.linalg.norm(error[:3]):.1f} mm and {np.linalg.norm(error[3:]):.3f} rad off"
    k = pose.free
    if k is None:
        noted = "".join(f" {CAUSES[name][0].upper()}{CAUSES[name][1:]}." for name in pose.faults)
        state = "above" if pose.row["Q"] >= pose.row["threshold"] else "below"
        return f"All hold, {off}. Q is {state} its threshold. {_others(pose, None)}{noted}"
    doing = {
        "unload": f"finger {k} lets go: Q fell below its threshold",
        "slide": f"finger {k} slides: Q fell below its threshold",
        "press": f"finger {k} presses until it feels the object again",
        "load": f"finger {k} takes its share of the load again",
    }.get(pose.phase, f"finger {k} is free")
    return f"{doing[0].upper()}{doing[1:]}; {_others(pose, k)} The object is {off}."


def _others(pose: Pose, free: int | None) -> str:
    """How much more the holding fingers can press."""
    holding = [j for j in range(len(pose.tips)) if j != free and pose.touching[j]]
    if not holding:
        return "no finger touches the object."
    reserve = pose.reserve()
    weakest = min(holding, key=lambda j: float(reserve[j]))
    who = "the others hold" if free is not None else f"{len(holding)} fingers hold"
    return f"{who} with {reserve[weakest]:.1f} N to spare."
