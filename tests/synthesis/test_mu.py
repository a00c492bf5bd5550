"""mu bounds against textbooks, SLICOT and properties that hold for any matrix."""

import importlib.util

import numpy as np
import pytest
import slycot

from fingergait.synthesis import mu_bounds
from fingergait.synthesis.blocks import parse_blocks
from fingergait.synthesis.mu_upper import upper_bound
from fingergait.synthesis.statespace import close_loop

from .distillation import BLOCKS, OMEGA, generalized_plant, inverse_controller


def random_matrices(n: int, rows: int, columns: int, seed: int = 0) -> np.ndarray:
    rng = np.random.default_rng(seed)
    return rng.normal(size=(n, rows, columns)) + 1j * rng.normal(size=(n, rows, columns))


def test_example_8_5_of_skogestad_and_postlethwaite():
    """M = [[2, 2], [-1, -1]]: 3.162 (sigma_max) for a full block, 3 for a diagonal one, 1 for a repeated scalar."""
    M = np.array([[2.0, 2.0], [-1.0, -1.0]])
    for blocks, expected in (([(2, 2)], np.sqrt(10.0)), ([(1, 1), (1, 1)], 3.0), ([(2, 0)], 1.0)):
        upper, lower = mu_bounds(M, blocks)
        np.testing.assert_allclose([upper[0], lower[0]], expected, rtol=1e-5)


def test_distillation_column_with_the_inverse_controller():
    """The book prints 5.77; its controller is rounded to four digits, hence the half percent."""
    M = close_loop(generalized_plant().at(OMEGA), inverse_controller(OMEGA))
    upper, lower = mu_bounds(M, BLOCKS)
    assert upper.max() == pytest.approx(5.77, rel=0.005)
    assert lower.max() == pytest.approx(upper.max(), rel=1e-3)


def test_slicot_example_of_ab13md():
    """Two real scalars, a full 2x2 block and two complex scalars: the routine's documentation prints 41.74753408."""
    half = [
        [-1 + 6j, 2 - 3j, 3 + 8j],
        [3 + 8j, -5 - 9j, -6 + 2j],
        [4 + 2j, -2 + 5j, -6 - 7j],
        [-4 + 11j, 8 - 7j, 12 - 1j],
        [5 - 4j, -4 - 8j, 1 - 3j],
        [-6 + 14j, 2 - 5j, 4 + 16j],
    ]
    Z = np.array(half + half).reshape(6, 6)
    upper, lower = mu_bounds(Z, [(-1, 0), (-1, 0), (2, 2), (1, 1), (1, 1)])
    assert upper[0] == pytest.approx(41.74753408, rel=1e-5)
    assert 0.9 * upper[0] < lower[0] <= upper[0]


def test_upper_bound_agrees_with_ab13md_on_random_matrices():
    M = random_matrices(20, 7, 7)
    for blocks, sizes, kinds in (
        ([(1, 1), (2, 2), (1, 1), (3, 3)], [1, 2, 1, 3], [2, 2, 2, 2]),
        ([(-1, 0), (-1, 0), (2, 2), (3, 3)], [1, 1, 2, 3], [1, 1, 2, 2]),
    ):
        expected = [slycot.ab13md(m, np.array(sizes), np.array(kinds))[0] for m in M]
        upper, _ = mu_bounds(M, blocks)
        np.testing.assert_allclose(upper, expected, rtol=5e-5)


@pytest.mark.parametrize("seed", range(4))
def test_lower_is_below_upper_and_close_for_three_full_blocks(seed):
    """With at most three full blocks the upper bound is mu itself, so the gap is the power iteration's alone."""
    M = random_matrices(20, 5, 7, seed)
    upper, lower = mu_bounds(M, [(2, 1), (3, 2), (2, 2)])
    assert np.all(lower <= upper * (1 + 1e-9))
    assert np.all(lower >= 0.98 * upper)


def test_mixed_structures_are_bounded_both_ways():
    M = random_matrices(5, 6, 6)
    upper, lower = mu_bounds(M, [(-2, 0), (2, 0), (2, 2)])
    assert np.all(lower <= upper * (1 + 1e-9))
    assert np.all(lower > 0.5 * upper)


def test_real_mu_is_at_most_complex_mu():
    M = random_matrices(10, 6, 6)
    real, _ = mu_bounds(M, [(-2, 0), (-1, 0), (1, 1), (2, 2)])
    complex_, _ = mu_bounds(M, [(2, 0), (1, 0), (1, 1), (2, 2)])
    assert np.all(real <= complex_ * (1 + 1e-6))


def test_real_scalars_against_a_brute_force_sweep():
    """The smallest |delta| that makes I - M diag(delta) singular, found on a fine grid of real deltas, is 1/mu."""
    rng = np.random.default_rng(3)
    for _ in range(5):
        M = rng.normal(size=(2, 2))
        upper, lower = mu_bounds(M, [(-1, 0), (-1, 0)])
        ratio = np.concatenate([np.linspace(-1, 1, 4001), np.linspace(-1, 1, 4001)])
        pairs = np.stack([np.where(np.arange(8002) < 4001, 1.0, ratio), np.where(np.arange(8002) < 4001, ratio, 1.0)])
        best = 0.0
        for d1, d2 in np.concatenate([pairs.T, -pairs.T]):
            # det(I - k M D) = 1 - k tr(M D) + k^2 det(M D): the largest real 1/k
            t, d = M[0, 0] * d1 + M[1, 1] * d2, np.linalg.det(M) * d1 * d2
            if t * t >= 4 * d:
                best = max(best, (t + np.sqrt(t * t - 4 * d)) / 2, (t - np.sqrt(t * t - 4 * d)) / 2)
        assert lower[0] <= best * (1 + 1e-6)
        assert upper[0] >= best * (1 - 1e-6)
        assert lower[0] >= 0.99 * best


def test_extreme_structures():
    """One full block: the largest singular value. One repeated complex scalar: the spectral radius."""
    M = random_matrices(6, 4, 4)
    upper, lower = mu_bounds(M, [(4, 4)])
    np.testing.assert_allclose(upper, np.linalg.norm(M, 2, axis=(1, 2)), rtol=1e-6)
    np.testing.assert_allclose(lower, upper, rtol=1e-6)
    radius = np.abs(np.linalg.eigvals(M)).max(axis=1)
    upper, lower = mu_bounds(M, [(4, 0)])
    np.testing.assert_allclose(upper, radius, rtol=2e-3)
    np.testing.assert_allclose(lower, radius, rtol=1e-9)


def test_scaling_and_invariance():
    """mu(a M) = |a| mu(M), and scalings that commute with Delta leave it alone."""
    M = random_matrices(4, 5, 5)
    blocks = [(1, 1), (2, 2), (2, 0)]
    upper, _ = mu_bounds(M, blocks)
    np.testing.assert_allclose(mu_bounds(1e-3j * M, blocks)[0], 1e-3 * upper, rtol=1e-4)
    d = np.array([1e4, 1.0, 1.0, 1e-3, 1e-3])
    np.testing.assert_allclose(mu_bounds(d[:, None] * M / d, blocks)[0], upper, rtol=1e-4)


@pytest.mark.parametrize("blocks", [[(1, 1), (2, 2), (2, 0)], [(-1, 0), (-2, 0), (2, 2)], [(-1, 0)] * 5, [(5, 5)]])
def test_bounds_are_homogeneous_over_all_numbers(blocks):
    """mu(c M) = |c| mu(M), to the last digit for powers of two, also for many sizes at once."""
    M = random_matrices(1, 5, 5, 7)
    upper, lower = mu_bounds(M, blocks)
    assert 0.0 <= lower[0] <= upper[0] and upper[0] > 0.0
    for c in (1e-300, 1e-200, 1e-12, 1e12, 1e200, 1e300):
        np.testing.assert_allclose(np.divide(mu_bounds(c * M, blocks), c), [upper, lower], rtol=1e-5)
    powers = 2.0 ** np.array([-900, -40, 0, 40, 900])
    many = mu_bounds(powers[:, None, None] * M, blocks)
    np.testing.assert_allclose(many[0], powers * upper, rtol=1e-12)
    np.testing.assert_allclose(many[1], powers * lower, rtol=1e-12)


def test_scalings_of_a_huge_matrix_prove_its_bound():
    """M^H Dz M + j (G M - M^H G^H) <= value^2 Dw holds where its squares can be computed."""
    blocks = parse_blocks([(-1, 0), (-2, 0), (2, 2)])
    M = 1e100 * random_matrices(1, 5, 5, 8)
    proof = upper_bound(M, blocks)
    N, G, value = M / 1e100, proof.G / 1e100, proof.value / 1e100
    NH = np.conj(np.swapaxes(N, 1, 2))
    skew = 1j * (G @ N)
    left = NH @ proof.Dz @ N + skew + np.conj(np.swapaxes(skew, 1, 2))
    gap = value[:, None, None] ** 2 * proof.Dw - left
    assert np.linalg.eigvalsh(gap).min() >= -1e-9 * np.abs(left).max()


@pytest.mark.parametrize(("value", "shown"), [(np.nan, "nan"), (np.inf, "inf"), (complex(0.0, -np.inf), "inf")])
def test_numbers_that_are_not_finite_are_named(value, shown):
    M = np.ones((2, 3, 3), complex)
    M[1, 2, 0] = value
    with pytest.raises(ValueError, match=rf"M\[1, 2, 0\]: expected a finite number, found .*{shown}"):
        mu_bounds(M, [(1, 1), (2, 2)])


def test_zero_and_nilpotent_matrices():
    upper, lower = mu_bounds(np.zeros((3, 3)), [(1, 1), (2, 2)])
    assert upper[0] == lower[0] == 0.0
    upper, _ = mu_bounds(np.array([[0.0, 1.0], [0.0, 0.0]]), [(1, 1), (1, 1)])
    assert upper[0] < 1e-3


@pytest.mark.parametrize("blocks", [[(1, 1)], [(0, 1), (2, 2)], [(-2, 3)], []])
def test_wrong_blocks_are_refused(blocks):
    with pytest.raises(ValueError, match="blocks"):
        mu_bounds(np.eye(3), blocks)


def test_agreement_with_dkpy():
    """A development-only oracle: dkpy's LMI bisection on small complex problems."""
    if importlib.util.find_spec("dkpy") is None:
        pytest.skip("dkpy is not installed; it is an oracle for development only")
    import dkpy

    M = random_matrices(3, 4, 4)
    blocks = [[1, 1], [1, 1], [2, 2]]
    expected = dkpy.SsvLmiBisection(n_jobs=None).compute_ssv(np.moveaxis(M, 0, -1), blocks)[0]
    upper, _ = mu_bounds(M, [(1, 1), (1, 1), (2, 2)])
    np.testing.assert_allclose(upper, expected, rtol=1e-3)
