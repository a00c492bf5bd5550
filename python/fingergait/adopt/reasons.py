"""Why an object can't be turned, in words with figures: the first constraint that nothing satisfies."""

import numpy as np

from fingergait.adopt.evaluate import Judge
from fingergait.adopt.funnel import Funnel


def reason(judge: Judge, funnel: Funnel, stage: str) -> str:
    """One sentence on the nearest miss of `stage`."""
    if stage == "clear":
        missing = [j for j in range(judge.n) if j not in funnel.clear] or list(range(judge.n))
        return next((funnel.example[j] for j in missing if j in funnel.example), "no place leaves all links clear")
    _, words, grasp = funnel.nearest.get(stage, (0.0, "", None))
    if grasp is None:
        return f"no finger can be spared: {words}" if stage == "spare" else words
    contacts = judge.contacts(*grasp)
    fingers = judge.hand.fingers
    asked = judge.options.load_limit
    if stage == "hold":
        held = judge.statics.holding(contacts, None)
        return f"the fingers cannot hold it: {_needs(judge, held.factor, held.joint)}, {asked:g} allowed"
    loads = [judge.statics.holding(contacts, j) for j in range(judge.n)]
    j = int(np.argmax([held.factor for held in loads]))
    needs = _needs(judge, loads[j].factor, loads[j].joint)
    return f"finger {fingers[j].name} cannot be spared: the others {needs}, {asked:g} allowed"


def _needs(judge: Judge, factor: float, joint: tuple[int, int]) -> str:
    if not np.isfinite(factor):
        return f"cannot carry the load at any torque with friction {judge.options.friction:g}"
    finger = judge.hand.fingers[joint[0]]
    name = judge.hand.model.joint(finger.joints[joint[1]]).name
    return f"carry {factor:.2g} times their torque limit at {name}"
