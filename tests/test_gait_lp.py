"""The gait LP, eq. (4), from Python: against HiGHS, at its limits, its errors."""

from typing import Any

import numpy as np
import pytest
from scipy.optimize import linprog

import fingergait as fg


@pytest.mark.parametrize("n", [1, 3, 4, 8])
@pytest.mark.parametrize("degenerate", [False, True])
def test_agrees_with_highs(n: int, degenerate: bool) -> None:
    rng = np.random.default_rng([n, degenerate])
    feasible = 0
    for _ in range(100):
        if degenerate:
            c, a, p, q = rng.choice([-1.0, -0.5, 0.0, 0.0, 0.5, 1.0], (4, n))
        else:
            c, a, p, q = rng.uniform(-1, 1, (4, n))
        lower, upper = np.minimum(p, q), np.maximum(p, q)
        s = fg.gait_lp(c, a, lower, upper)
        assert (lower <= s.x).all() and (s.x <= upper).all()
        highs = linprog(-c, A_eq=a[None], b_eq=[0.0], bounds=np.stack([lower, upper], axis=1), method="highs")
        assert s.feasible == (highs.status == 0)
        if s.feasible:
            feasible += 1
            assert abs(a @ s.x) < 1e-12
            assert s.value == pytest.approx(-highs.fun, abs=1e-6)
            assert s.value == pytest.approx(c @ s.x, abs=1e-12)
            assert s.value >= -highs.fun - 1e-6
    assert feasible > 10


def test_the_papers_limits() -> None:
    """Velocities within 1 rad/s and sigma = 0.002 rad/s of the last ones."""
    last = np.array([0.5, -0.2, 0.999])
    lower, upper = np.maximum(-1.0, last - 0.002), np.minimum(1.0, last + 0.002)
    c, a = np.array([1.0, 0.3, -0.2]), np.array([0.04, -0.02, 0.01])
    s = fg.gait_lp(c, a, lower, upper)
    # a . last is far from zero: the box is kept, and a . x brought as near zero as it allows.
    assert not s.feasible
    np.testing.assert_allclose(s.x, [0.498, -0.198, 0.997])


def test_an_infeasible_box_is_kept() -> None:
    s = fg.gait_lp([1.0, 1.0], [1.0, 1.0], [1.0, 2.0], [3.0, 4.0])
    assert not s.feasible
    np.testing.assert_array_equal(s.x, [1.0, 2.0])
    assert s.value == 3.0


@pytest.mark.parametrize(
    ("arguments", "error", "message"),
    [
        (([1, 2], [1], [0, 0], [1, 1]), fg.ShapeError, r"a: expected shape \(2,\)"),
        (([1, 2], [1, 1], [0, 0, 0], [1, 1]), fg.ShapeError, r"lower"),
        (([[1, 2]], [1, 1], [0, 0], [1, 1]), fg.ShapeError, r"c: expected shape \(n,\), found \(1, 2\)"),
        (([1, np.nan], [1, 1], [0, 0], [1, 1]), fg.ConfigError, r"c\[1\]: expected a finite number, found NaN"),
        (([1, 2], [1, 1], [0, 0], [1, np.inf]), fg.ConfigError, r"upper\[1\]"),
        (([1, 2], [1, 1], [0, 2], [1, 1]), fg.ConfigError, r"lower\[1\]: expected at most upper\[1\] = 1, found 2"),
    ],
)
def test_mistakes_are_named(arguments: Any, error: type[Exception], message: str) -> None:
    with pytest.raises(error, match=message) as caught:
        fg.gait_lp(*arguments)
    assert isinstance(caught.value, fg.FingergaitError) and isinstance(caught.value, ValueError)
