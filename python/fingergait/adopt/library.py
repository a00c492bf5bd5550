"""Postures of each finger, drawn once for a hand: where its tip can be without touching itself or the palm."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.stats import qmc

from fingergait.adopt.kinematics import Chain
from fingergait.adopt.view import FingerView, HandView

Array = NDArray[np.float64]

_HOME_MARGIN = 0.06  # of a joint's range: where a grasp begins, it must still be able to go either way


@dataclass(frozen=True)
class Library:
    """For each finger: its chain, postures q (N, n_j) that fill its joint space evenly, and tip centres (N, 3) in W."""

    chains: tuple[Chain, ...]
    q: tuple[Array, ...]
    centre: tuple[Array, ...]


def draw_library(hand: HandView, samples: int, seed: int) -> Library:
    """`samples` postures of each finger, the same for the same seed."""
    chains = tuple(Chain(hand.model, finger, links) for finger, links in zip(hand.fingers, hand.links, strict=True))
    q = tuple(_postures(finger, samples, seed + j) for j, finger in enumerate(hand.fingers))
    centre = tuple(chain.at(angles).centre for chain, angles in zip(chains, q, strict=True))
    return Library(chains, q, centre)


def _postures(finger: FingerView, samples: int, seed: int) -> Array:
    unit = qmc.Sobol(finger.n, seed=seed).random_base2(max(1, int(np.ceil(np.log2(samples)))))
    span = finger.upper - finger.lower
    postures: Array = finger.lower + (_HOME_MARGIN + (1.0 - 2.0 * _HOME_MARGIN) * unit) * span
    return postures
