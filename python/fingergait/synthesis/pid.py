"""The hand-tuned baseline: one PID on every axis of the pose error."""

from __future__ import annotations

from .statespace import StateSpace


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
    return StateSpace([[0.0, 0.0], [0.0, -1.0 / T]], [[1.0], [1.0 / T]], [[ki, -kd / T]], [[kp + kd / T]])
