"""Skogestad and Postlethwaite's distillation column: a plant whose mu is printed in a textbook.

G(s) = 1/(75 s + 1) [[87.8, -86.4], [108.2, -109.6]], input uncertainty w_I = (s + 0.2)/(0.5 s + 1) on each input,
performance W_P = (s/2 + 0.05)/s on the output sensitivity. Time in minutes.
"""

import numpy as np

from fingergait.synthesis.interconnect import interconnect
from fingergait.synthesis.statespace import StateSpace, append, first_order_chain

G0 = np.array([[87.8, -86.4], [108.2, -109.6]])
BLOCKS = [(1, 1), (1, 1), (2, 2)]
OMEGA = np.logspace(-3.0, 3.0, 120)


def generalized_plant() -> StateSpace:
    """Inputs (w of the uncertainty, disturbance at the output, u); outputs (z, weighted output, -y)."""
    lag = first_order_lag(75.0)
    uncertainty = first_order_chain([0.2], [2.0], 2.0)
    performance = first_order_chain([0.1], [1e-6], 0.5)
    blocks = append(lag, lag, uncertainty, uncertainty, performance, performance)
    zero, one = np.zeros((2, 2)), np.eye(2)
    feedback = np.block([[zero, zero, zero], [zero, zero, zero], [G0, zero, zero]])
    entry = np.block([[one, zero, one], [zero, zero, one], [zero, one, zero]])
    readout = np.block([[zero, one, zero], [zero, zero, one], [-G0, zero, zero]])
    direct = np.block([[zero, zero, zero], [zero, zero, zero], [zero, -one, zero]])
    return interconnect(blocks, feedback, entry, readout, direct)


def first_order_lag(time: float) -> StateSpace:
    return StateSpace(np.array([[-1.0 / time]]), np.ones((1, 1)), np.array([[1.0 / time]]), np.zeros((1, 1)))


def inverse_controller(omega: np.ndarray) -> np.ndarray:
    """K(j omega) = 0.7/s G(s)^-1, (n_w, 2, 2)."""
    s = 1j * omega
    return (0.7 * (75.0 * s + 1.0) / s)[:, None, None] * np.linalg.inv(G0)
