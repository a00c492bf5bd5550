"""The damping that the hand adds to the object, identified from a run in contact."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike

from fingergait.run.pose_error import pose_errors

from .spec import SynthesisSpec
from .statespace import Array

if TYPE_CHECKING:  # what runs a simulation is not needed to read its log
    from fingergait.run.log import Log
    from fingergait.scenario import Scenario

_WINDOW = 1.0  # s from the start of a pulse that are used
_SMOOTH = 9  # samples of the cubic fit that differentiates the pose


def identify_damping(log: Log, scenario: Scenario, spec: SynthesisSpec) -> Array:
    """B (6, 6) of M V' + B V = wrench, in W at Oo, [translation; rotation], from pulses on an object at rest.

    Kinematics alone (`reflect`) leave out the torsional friction of the fingertips and the softness of the contacts,
    and say nothing about which grasp to take: the arms move as the object is lifted.

    Parameters
    ----------
    log, scenario
        A run whose reference is constant during the pulses, such as `push-at-rest`. The true pose is differentiated:
        this is for the design of a controller, not for use in one. The wrench is what K asked for, `F_des`.
    spec
        Gives the nominal object, the fingers' inertia and the motors' lag.

    Returns
    -------
    ndarray
        Least squares over the second after the start of each pulse; N s/m, N s and N m s. Nothing forces it to be
        symmetric: how far it is from that tells how well the model fits.

    Raises
    ------
    ValueError
        If the scenario has no pulse or the spec no hand.
    """
    from scipy.signal import savgol_filter  # takes a second to import, and every command imports this module

    if not scenario.disturbance or spec.hand is None:
        raise ValueError("identify_damping: needs a scenario with [[disturbance]] pulses and a spec with a [hand]")
    t, dt = log.t, scenario.period
    moved = pose_errors(log.pose("desired"), log.pose("object"))  # true pose minus desired pose
    twist = savgol_filter(moved, _SMOOTH, 3, deriv=1, delta=dt, axis=0)
    acceleration = savgol_filter(moved, _SMOOTH, 3, deriv=2, delta=dt, axis=0)
    wrench = _lagged(log.block("F_des"), spec.control.motor_lag, dt)
    used = np.zeros(len(t), dtype=bool)
    for pulse in scenario.disturbance:
        on = (t >= pulse.at) & (t < pulse.at + pulse.duration)
        wrench[on] += np.concatenate([pulse.force, pulse.torque])
        used |= (t >= pulse.at) & (t < pulse.at + _WINDOW)
    truth = scenario.truth
    scales = np.concatenate([[truth.mass_scale] * 3, np.broadcast_to(truth.inertia_scale, 3)])
    inertia = np.diag(scales) @ spec.nominal_inertia() + np.array(spec.hand.inertia)
    left = wrench - acceleration @ inertia.T
    terms = np.column_stack([twist[used], np.ones(used.sum())])  # the constant is the weight
    solution, *_ = np.linalg.lstsq(terms, left[used], rcond=None)
    return np.asarray(solution[:6].T)


def _lagged(command: ArrayLike, lag: float, dt: float) -> Array:
    """The motors' torque at each sample, from commands (T, 6) held from sample to sample; a first-order lag, s."""
    from scipy.signal import lfilter

    pole = np.exp(-dt / lag) if lag > 0.0 else 0.0
    return np.asarray(lfilter([0.0, 1.0 - pole], [1.0, -pole], np.asarray(command, dtype=float), axis=0))
