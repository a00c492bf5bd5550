"""Other QP solvers, for comparison only: `pip install 'fingergait[peers]'`. What is not installed is left out.

Each is called as its Python users call it, on the QP in the contact forces alone. Time is thread CPU time of that call,
so it has some microseconds of Python in it; so has the row `force_qp/python` of our own.
"""

import importlib
from collections.abc import Callable

import numpy as np

from fingergait.bench.instances import Array, DenseQp

Solve = Callable[[DenseQp], Array]


def installed() -> dict[str, Solve]:
    """The peers that can be imported, by name."""
    made: dict[str, Callable[[], Solve]] = {
        "daqp": _daqp,
        "quadprog": _quadprog,
        "piqp": _piqp,
        "proxsuite": _proxsuite,
        "osqp": _osqp,
        "clarabel": _clarabel,
    }
    found = {}
    for name, make in made.items():
        try:
            importlib.import_module(name)
        except ImportError:
            continue
        found[name] = make()
    return found


def _one_sided(qp: DenseQp) -> tuple[Array, Array]:
    """C f >= b."""
    low, high = np.isfinite(qp.lower), np.isfinite(qp.upper)
    return np.vstack([qp.A[low], -qp.A[high]]), np.concatenate([qp.lower[low], -qp.upper[high]])


def _daqp() -> Solve:
    import daqp

    last: list[Array] = []

    def solve(qp: DenseQp) -> Array:
        upper, lower = np.minimum(qp.upper, 1e30), np.maximum(qp.lower, -1e30)
        start = {"primal_start": last[0]} if last else {}
        x = daqp.solve(qp.H, qp.q, qp.A, upper, lower, np.zeros(len(upper), dtype=np.intc), **start)[0]
        last[:] = [np.asarray(x)]
        return last[0]

    return solve


def _quadprog() -> Solve:
    import quadprog

    def solve(qp: DenseQp) -> Array:
        C, b = _one_sided(qp)
        return np.asarray(quadprog.solve_qp(qp.H, -qp.q, C.T, b)[0])

    return solve


def _piqp() -> Solve:
    import piqp

    def solve(qp: DenseQp) -> Array:
        solver = piqp.DenseSolver()
        solver.settings.eps_abs = solver.settings.eps_rel = 1e-9
        solver.setup(np.asfortranarray(qp.H), qp.q, G=np.asfortranarray(qp.A), h_l=qp.lower, h_u=qp.upper)
        solver.solve()
        return np.array(solver.result.x)

    return solve


def _proxsuite() -> Solve:
    from proxsuite import proxqp

    def solve(qp: DenseQp) -> Array:
        solver = proxqp.dense.QP(len(qp.q), 0, len(qp.A))
        solver.settings.eps_abs = 1e-6
        solver.settings.max_iter = 200
        solver.init(qp.H, qp.q, None, None, qp.A, np.maximum(qp.lower, -1e20), np.minimum(qp.upper, 1e20))
        solver.solve()
        return np.array(solver.results.x)

    return solve


def _osqp() -> Solve:
    import osqp
    from scipy import sparse

    def solve(qp: DenseQp) -> Array:
        solver = osqp.OSQP()
        H, A = sparse.csc_matrix(np.triu(qp.H)), sparse.csc_matrix(qp.A)
        options = {"eps_abs": 1e-6, "eps_rel": 1e-6, "max_iter": 4000, "polishing": True, "verbose": False}
        solver.setup(H, qp.q, A, qp.lower, qp.upper, **options)
        return np.asarray(solver.solve(raise_error=False).x)

    return solve


def _clarabel() -> Solve:
    import clarabel
    from scipy import sparse

    settings = clarabel.DefaultSettings()
    settings.verbose = False

    def solve(qp: DenseQp) -> Array:
        C, b = _one_sided(qp)
        H, A = sparse.csc_matrix(np.triu(qp.H)), sparse.csc_matrix(-C)
        cones = [clarabel.NonnegativeConeT(len(b))]
        return np.array(clarabel.DefaultSolver(H, qp.q, A, -b, cones, settings).solve().x)

    return solve
