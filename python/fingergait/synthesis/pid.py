"""The hand-tuned baseline: one PID on every axis of the pose error."""

from __future__ import annotations

from .discretise import DiscreteController, discretise
from .statespace import StateSpace, system


def pid(bandwidth: float, derivative_filter: float) -> StateSpace:
    """u = (kp + ki/s + kd s/(T s + 1)) e with kp = 1.5 w^2, kd = 2.25 w, ki = .25 w^3.

    On a double integrator these gains put the closed loop's bandwidth near w. States: integral of e, filtered e.

    Parameters
    ----------
    bandwidth : w, rad/s
    derivative_filter : T, s
    """
    w, T = bandwidth, derivative_filter
    kp, kd, ki = 1.5 * w**2, 2.25 * w, 0.25 * w**3
    # kd s/(T s + 1) = kd/T - (kd/T) x_f,  T x_f' = e - x_f
    return system([[0.0, 0.0], [0.0, -1.0 / T]], [[1.0], [1.0 / T]], [[ki, -kd / T]], [[kp + kd / T]])


def pid_controller(
    bandwidth: float, derivative_filter: float, dt: float, windup_decay: float = 10.0
) -> DiscreteController:
    """The PID of one axis at sample time dt (s), with its anti-windup gain."""
    return discretise(pid(bandwidth, derivative_filter), dt, windup_decay=windup_decay)
