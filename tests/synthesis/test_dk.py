"""The D-K iteration, its H-infinity step and its D fit."""

import numpy as np
import pytest

from fingergait.synthesis import LibraryError, StateSpace, SynthesisError, dk_iteration, mu_bounds
from fingergait.synthesis.dfit import fit_magnitude
from fingergait.synthesis.dk import scalar_structure, scaled_plant
from fingergait.synthesis.hinf import h_infinity, h_infinity_norm
from fingergait.synthesis.statespace import close_loop, first_order_chain, lft_lower

from .distillation import BLOCKS, OMEGA, generalized_plant


@pytest.fixture(scope="module")
def column():
    return dk_iteration(generalized_plant(), 2, 2, BLOCKS, OMEGA, iterations=3, band=(1e-3, 1e3))


def test_distillation_column_in_three_iterations(column):
    """The book: about 1.18, 1.024, 1.019; the optimum is 0.974."""
    assert column.mu_peak <= 1.05
    assert len(column.history) == 3
    assert column.history[0].mu_peak == pytest.approx(1.19, abs=0.02)


def test_the_best_iterate_is_kept(column):
    assert column.mu_peak == min(step.mu_peak for step in column.history)


def test_mu_of_the_result_is_what_it_says(column):
    M = close_loop(generalized_plant().at(OMEGA), column.K.at(OMEGA))
    upper, _ = mu_bounds(M, BLOCKS)
    assert upper.max() == pytest.approx(column.mu_peak, rel=1e-3)


def test_scaled_norm_is_at_most_gamma(column):
    """||D F_l(P, K) D^-1||_inf of the fitted scalings, by AB13DD, is what the K step promised."""
    P = generalized_plant()
    scaled = scaled_plant(P, scalar_structure(BLOCKS), column.scaling, 2, 2)
    gamma = min(column.history, key=lambda step: step.mu_peak).gamma
    assert h_infinity_norm(lft_lower(scaled, column.K)) <= gamma * (1 + 1e-3)
    assert column.mu_peak <= gamma * (1 + 1e-3)


def test_a_plant_from_python_control_is_accepted():
    control = pytest.importorskip("control")
    P = generalized_plant()
    result = dk_iteration(control.ss(P.A, P.B, P.C, P.D), 2, 2, BLOCKS, OMEGA, iterations=1)
    assert result.mu_peak == pytest.approx(1.19, abs=0.02)


def test_an_unstabilisable_plant_fails_loudly():
    """An unstable mode that u does not reach."""
    A = np.diag([1.0, -1.0])
    B = np.array([[1.0, 0.0, 0.0], [0.0, 1.0, 1.0]])
    C = np.array([[1.0, 1.0], [0.0, 0.0], [1.0, 1.0]])
    D = np.array([[0.0, 0.0, 0.0], [0.0, 0.0, 1.0], [0.0, 1.0, 0.0]])
    with pytest.raises(LibraryError, match="SB10AD"):
        h_infinity(StateSpace(A, B, C, D), 1, 1)
    with pytest.raises(SynthesisError, match="first K step"):
        dk_iteration(StateSpace(A, B, C, D), 1, 1, [(2, 2)], np.logspace(-1, 1, 10))


def test_norm_of_an_unstable_system_is_refused():
    with pytest.raises(LibraryError, match="not stable"):
        h_infinity_norm(StateSpace(np.eye(1), np.eye(1), np.eye(1), np.zeros((1, 1))))


def test_fit_recovers_a_rational_magnitude():
    omega = np.logspace(-2, 4, 120)
    truth = first_order_chain([3.0, 200.0], [20.0, 50.0], 2.5)
    magnitude = np.abs(truth.at(omega)[:, 0, 0])
    fit = fit_magnitude(omega, magnitude, max_order=4, tolerance=1e-4)
    assert fit.error < 1e-2
    assert fit.statespace().is_stable() and fit.inverse().is_stable()
    np.testing.assert_allclose(np.abs(fit.statespace().at(omega)[:, 0, 0]), np.exp(fit.log_magnitude(omega)), rtol=1e-9)
    product = (fit.statespace() @ fit.inverse()).at(omega)[:, 0, 0]
    np.testing.assert_allclose(product, 1.0, rtol=1e-9)


def test_fit_of_a_constant_has_no_states():
    omega = np.logspace(-1, 3, 40)
    fit = fit_magnitude(omega, np.full(40, 7.0))
    assert fit.order == 0 and fit.gain == pytest.approx(7.0)
