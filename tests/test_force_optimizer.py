"""The force optimisation QP, eq. (8), from Python: the minimiser, its limits, its errors."""

import threading
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.optimize import nnls

import fingergait as fg

Array = NDArray[np.float64]
ALPHA = (0.01, 0.01, 1000.0)


def pyramid(mu: float, m: int) -> Array:
    """Edges (3, m) of the pyramid inscribed in the cone of friction coefficient mu."""
    angle = 2 * np.pi * np.arange(m) / m
    return np.stack([mu * np.cos(angle), mu * np.sin(angle), np.ones(m)])


def problem(rng: np.random.Generator, n: int, push: float) -> dict[str, Any]:
    """n fingers of three joints around a cylinder of 3 cm, about 30 N of grasp, `push` newtons of disturbance."""
    G = np.zeros((6, 3 * n))
    J = np.zeros((3 * n, 3 * n))
    for i in range(n):
        yaw = 2 * np.pi * (i + rng.uniform(-0.2, 0.2)) / n
        z = -np.array([np.cos(yaw), np.sin(yaw), 0.0])
        x = np.cross(z, [0.0, 0.0, 1.0])
        R = np.stack([x, np.cross(z, x), z], axis=1)
        p = -0.03 * z + [0.0, 0.0, rng.uniform(-0.02, 0.02)]
        block = slice(3 * i, 3 * i + 3)
        G[:3, block] = R
        G[3:, block] = np.cross(p, R.T).T
        J[block, block] = rng.uniform(-0.08, 0.08, (3, 3))
    F_des = np.append([0.0, 0.0, 5.0] + push * rng.uniform(-1, 1, 3), 0.02 * push * rng.uniform(-1, 1, 3))
    return {
        "G": G,
        "J": J,
        "F_des": F_des,
        "f_prev": np.tile([0.0, 0.0, 4.0], n) + rng.uniform(-0.5, 0.5, 3 * n),
        "tau_min": np.full(3 * n, -0.5),
        "tau_max": np.full(3 * n, 0.5),
    }


def reference(edges: Array, q: dict[str, Any]) -> Array:
    """The minimiser by Lawson and Hanson's least distance programming: a method and code of others."""
    a1, a2, a3 = ALPHA
    n = q["f_prev"].size
    L = np.linalg.cholesky((a1 + a2) * np.eye(n) + a3 * q["G"].T @ q["G"])
    centre = np.linalg.solve(L, a2 * q["f_prev"] + a3 * q["G"].T @ q["F_des"])
    A, b = [], []
    for i, e in enumerate(edges):
        normals = np.cross(e.T, np.roll(e.T, -1, axis=0))
        for normal in normals / np.linalg.norm(normals, axis=1, keepdims=True):
            A.append(np.zeros(n))
            A[-1][3 * i : 3 * i + 3] = normal
            b.append(0.0)
        cap = q.get("f_normal_max", np.full(len(edges), np.inf))[i]
        if np.isfinite(cap):
            A.append(np.zeros(n))
            A[-1][3 * i + 2] = -1.0
            b.append(-cap)
    A = np.vstack([A, q["J"].T, -q["J"].T])
    b = np.concatenate([b, q["tau_min"], -q["tau_max"]])
    # u = L' f - centre; A f >= b becomes M u >= d.
    M = np.linalg.solve(L, A.T).T
    d = b - M @ centre
    y, _ = nnls(np.vstack([M.T, d]), np.append(np.zeros(n), 1.0), maxiter=1000)
    r = np.vstack([M.T, d]) @ y - np.append(np.zeros(n), 1.0)
    return np.linalg.solve(L.T, centre - r[:-1] / r[-1])


@pytest.mark.parametrize("solver", ["active_set", "clarabel"])
@pytest.mark.parametrize(("n", "m"), [(2, 3), (3, 4), (3, 8), (4, 6), (5, 12)])
@pytest.mark.parametrize("push", [0.0, 5.0, 20.0])
def test_forces_are_the_minimiser(solver: str, n: int, m: int, push: float) -> None:
    rng = np.random.default_rng([n, m, int(push)])
    edges = np.stack([pyramid(0.6, m)] * n)
    optimizer = fg.ForceOptimizer(edges, ALPHA, solver)
    for _ in range(5):
        q = problem(rng, n, push)
        if rng.uniform() < 0.5:
            q["f_normal_max"] = rng.uniform(1.0, 8.0, n)
        s = optimizer.solve(**q)
        assert s.status == "solved"
        assert s.solver == {"active_set": "active_set", "clarabel": "clarabel_polished"}[solver]
        assert s.kkt < 1e-8 * max(10.0, np.abs(s.f).max())
        assert s.solve_ns > 0
        # The reference itself is good to about 1e-7 N where many rows are active.
        np.testing.assert_allclose(s.f, reference(edges, q), atol=1e-6, rtol=0)
        np.testing.assert_allclose(s.tau, q["J"].T @ s.f, atol=1e-12)
        np.testing.assert_allclose(s.psi, q["F_des"] - q["G"] @ s.f, atol=1e-12)


def test_forces_are_nonnegative_combinations_of_the_edges() -> None:
    rng = np.random.default_rng(1)
    edges = np.stack([pyramid(0.5, 8)] * 4)
    s = fg.ForceOptimizer(edges, ALPHA).solve(**problem(rng, 4, 20.0))
    for i in range(4):
        _, residual = nnls(edges[i], s.f[3 * i : 3 * i + 3])
        assert residual < 1e-9


def test_a_free_finger_carries_exactly_nothing() -> None:
    rng = np.random.default_rng(2)
    edges = np.stack([pyramid(0.8, 6)] * 4)
    optimizer = fg.ForceOptimizer(edges, ALPHA)
    q = problem(rng, 4, 1.0)
    assert np.linalg.norm(optimizer.solve(**q).f[3:6]) > 0.1
    s = optimizer.solve(**q, f_normal_max=[np.inf, 0.0, np.inf, np.inf])
    assert s.status == "solved"
    assert (s.f[3:6] == 0.0).all() and (s.tau[3:6] == 0.0).all()
    assert np.linalg.norm(s.psi) < 0.1


def test_torque_bounds_that_nothing_satisfies_hold_the_last_forces() -> None:
    rng = np.random.default_rng(3)
    optimizer = fg.ForceOptimizer(np.stack([pyramid(0.8, 6)] * 3), ALPHA)
    q = problem(rng, 3, 0.0)
    last = optimizer.solve(**q).f
    s = optimizer.solve(**{**q, "tau_min": np.full(9, 0.5), "tau_max": np.full(9, -0.5)})
    assert (s.status, s.solver) == ("held", "held")
    assert np.isfinite(s.f).all() and s.kkt > 0
    assert np.linalg.norm(s.f) <= np.linalg.norm(last) + 1e-12
    again = optimizer.solve(**q)
    assert again.status == "solved"
    np.testing.assert_allclose(again.f, last, atol=1e-9)


def test_any_array_will_do() -> None:
    rng = np.random.default_rng(4)
    edges = np.stack([pyramid(0.5, 4)] * 3)
    q = problem(rng, 3, 2.0)
    expected = fg.ForceOptimizer(edges, ALPHA).solve(**q).f
    optimizer = fg.ForceOptimizer(edges.tolist(), list(ALPHA))
    np.testing.assert_array_equal(optimizer.solve(**{k: v.tolist() for k, v in q.items()}).f, expected)
    fortran = {k: np.asfortranarray(v) for k, v in q.items()}
    np.testing.assert_allclose(optimizer.solve(**fortran).f, expected, atol=1e-9)
    strided = {k: np.repeat(v, 2, axis=-1)[..., ::2] for k, v in q.items()}
    np.testing.assert_allclose(optimizer.solve(**strided).f, expected, atol=1e-9)
    # The edges' order does not matter to the set they span.
    shuffled = fg.ForceOptimizer(edges[:, :, [2, 0, 3, 1]], ALPHA)
    np.testing.assert_allclose(shuffled.solve(**q).f, expected, atol=1e-9)


def test_joints_can_be_of_any_number() -> None:
    rng = np.random.default_rng(5)
    optimizer = fg.ForceOptimizer(np.stack([pyramid(0.5, 4)] * 3), ALPHA)
    q = problem(rng, 3, 2.0)
    for n_q in (9, 12, 7, 0):
        q |= {"J": rng.uniform(-0.05, 0.05, (9, n_q)), "tau_min": np.full(n_q, -0.5), "tau_max": np.full(n_q, 0.5)}
        s = optimizer.solve(**q)
        assert s.status == "solved" and s.tau.shape == (n_q,)
        assert (np.abs(s.tau) <= 0.5 + 1e-9).all()


def test_optimizers_work_side_by_side_in_threads() -> None:
    rng = np.random.default_rng(6)
    edges = np.stack([pyramid(0.5, 8)] * 4)
    q = problem(rng, 4, 5.0)
    expected = fg.ForceOptimizer(edges, ALPHA).solve(**q).f
    found: list[Array] = []

    def work() -> None:
        optimizer = fg.ForceOptimizer(edges, ALPHA)
        found.extend(optimizer.solve(**q).f for _ in range(50))

    threads = [threading.Thread(target=work) for _ in range(4)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert len(found) == 200
    for f in found:
        np.testing.assert_allclose(f, expected, atol=1e-9)


@pytest.mark.parametrize(
    ("change", "error", "message"),
    [
        ({"G": np.zeros((6, 6))}, fg.ShapeError, r"G: expected shape \(6, 9\), found \(6, 6\)"),
        ({"G": np.zeros(6)}, fg.ShapeError, r"G: expected shape \(rows, columns\), found \(6,\)"),
        ({"F_des": np.zeros(5)}, fg.ShapeError, r"F_des: expected shape \(6,\), found \(5,\)"),
        ({"f_prev": np.zeros((9, 1))}, fg.ShapeError, r"f_prev"),
        ({"tau_max": np.zeros(8)}, fg.ShapeError, r"tau_max: expected shape \(9,\), found \(8,\)"),
        ({"f_normal_max": [1.0, 1.0]}, fg.ShapeError, r"f_normal_max: expected shape \(3,\)"),
        ({"F_des": [0, 0, np.nan, 0, 0, 0]}, fg.ConfigError, r"F_des\[2\]: expected a finite number, found NaN"),
        ({"f_prev": np.full(9, np.inf)}, fg.ConfigError, r"f_prev\[0\]"),
        ({"tau_min": np.full(9, np.nan)}, fg.ConfigError, r"tau_min\[0\]"),
    ],
)
def test_mistakes_are_named_and_forgotten(change: dict[str, Any], error: type[Exception], message: str) -> None:
    q = problem(np.random.default_rng(7), 3, 2.0)
    optimizer = fg.ForceOptimizer(np.stack([pyramid(0.5, 4)] * 3), ALPHA)
    expected = optimizer.solve(**q).f
    with pytest.raises(error, match=message) as caught:
        optimizer.solve(**{**q, **change})
    assert isinstance(caught.value, fg.FingergaitError) and isinstance(caught.value, ValueError)
    np.testing.assert_allclose(optimizer.solve(**q).f, expected, atol=1e-9)


@pytest.mark.parametrize(
    ("edges", "alpha", "solver", "message"),
    [
        (np.zeros((3, 4)), ALPHA, "active_set", r"edges: expected shape \(n, 3, m\), found \(3, 4\)"),
        (np.zeros((2, 3, 4)), ALPHA, "active_set", r"edges\[0\]"),
        (np.stack([pyramid(0.5, 13)] * 2), ALPHA, "active_set", r"edges: expected 3 to 12 edges, found 13"),
        (np.stack([pyramid(0.5, 4)] * 7), ALPHA, "active_set", r"expected 1 to 6 contacts, found 7"),
        (np.stack([pyramid(0.5, 4)] * 3), (0.0, 0.0, 1.0), "active_set", r"alpha"),
        (np.stack([pyramid(0.5, 4)] * 3), (1.0, 1.0), "active_set", r"alpha: expected shape \(3,\)"),
        (np.stack([pyramid(0.5, 4)] * 3), ALPHA, "osqp", r"solver: expected .*clarabel.*, found osqp"),
    ],
)
def test_a_mistaken_construction_is_named(edges: Array, alpha: Any, solver: str, message: str) -> None:
    with pytest.raises(fg.FingergaitError, match=message):
        fg.ForceOptimizer(edges, alpha, solver)
