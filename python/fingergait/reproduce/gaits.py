"""What each gait did to the grasp quality, measured from the contacts and not predicted by the gait LP."""

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fingergait.run.log import Log

Array = NDArray[np.float64]

HOLD, SLIDE = 0, 2  # of the core's Phase


@dataclass(frozen=True)
class Gait:
    """One completed gait.

    begin, end
        Rows of the log: the first with a free finger, the first after it.
    slide
        Rows between which the finger slides.
    before, after
        Q at `begin` and `end`.
    rate
        Mean dQ/dt over the slide, 1/s.
    finger
        Index of the free finger.
    """

    begin: int
    end: int
    slide: tuple[int, int]
    before: float
    after: float
    rate: float
    finger: int


def completed_gaits(log: Log) -> list[Gait]:
    """The gaits that began and ended in the log and in which a finger slid."""
    t, quality, free, phase = log.t, log["Q"], log["free_finger"], log["phase"]
    edges = np.flatnonzero((np.diff(free) != 0.0) | (np.diff(log["gaits"]) != 0.0)) + 1
    bounds = [0, *edges.tolist(), len(free)]
    gaits = []
    for begin, end in zip(bounds[:-1], bounds[1:], strict=True):
        sliding = begin + np.flatnonzero(phase[begin:end] == SLIDE)
        if free[begin] < 0.0 or end >= len(free) or len(sliding) < 2:
            continue
        first, last = int(sliding[0]), int(sliding[-1])
        rate = (quality[last] - quality[first]) / (t[last] - t[first])
        gaits.append(Gait(begin, end, (first, last), quality[begin], quality[end], rate, int(free[begin])))
    return gaits


def gait_figures(log: Log, since: float) -> dict[str, Any]:
    """How the gaits that begin after `since`, s, served the quality.

    Returns
    -------
    dict
        `gaits`: how many; `rate_positive`: share with a positive measured dQ/dt over the slide; `raised`: share with Q
        higher after than before; `resting`: share of time in which no finger is free; `above`: share of the resting
        time with Q at or above its threshold; `falling_at`, `lowered_at`: when the gaits began, s, whose rate isn't
        positive, and that don't raise Q.
    """
    gaits = [gait for gait in completed_gaits(log) if log.t[gait.begin] >= since]
    counted = log.t >= since
    rests = counted & (log["free_finger"] < 0.0)
    above = (log["Q"] >= log["threshold"])[rests]
    return {
        "gaits": len(gaits),
        "rate_positive": float(np.mean([gait.rate > 0.0 for gait in gaits])) if gaits else None,
        "raised": float(np.mean([gait.after > gait.before for gait in gaits])) if gaits else None,
        "resting": float(rests.sum() / counted.sum()) if counted.any() else None,
        "above": float(above.mean()) if above.size else None,
        "falling_at": [float(log.t[gait.begin]) for gait in gaits if gait.rate <= 0.0],
        "lowered_at": [float(log.t[gait.begin]) for gait in gaits if gait.after <= gait.before],
    }


def measured_rate(t: Array, quality: Array, width: float = 0.02) -> Array:
    """dQ/dt, 1/s, of the quality sampled at `t`: differences over `width` seconds, centred."""
    half = max(1, round(0.5 * width / float(np.median(np.diff(t)))))
    rate = np.full(len(t), np.nan)
    rate[half:-half] = (quality[2 * half :] - quality[: -2 * half]) / (t[2 * half :] - t[: -2 * half])
    return rate
