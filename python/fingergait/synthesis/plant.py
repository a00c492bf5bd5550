"""The generalised plant of the paper's Fig. 'Generalized plant for robust controller design'."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from .blocks import Blocks, real_scalars
from .interconnect import interconnect
from .statespace import ComplexArray, StateSpace, append, gain, system
from .uncertainty import UncertainBody
from .weights import Weight


@dataclass(frozen=True)
class AxisWeights:
    """The weights of one axis: tracking, control effort, disturbance, measurement noise, and the reference's size."""

    perf: Weight
    effort: Weight
    disturbance: Weight
    noise: Weight
    reference: float = 1.0


@dataclass(frozen=True)
class Actuation:
    """What lies between K's output and the wrench: exp(-dead_time s) / (lag s + 1), times in s."""

    lag: float = 0.0
    dead_time: float = 0.0

    def rational(self) -> StateSpace:
        """The lag and a first-order Pade approximation of the dead time."""
        path = self.lag_only()
        if self.dead_time > 0.0:
            corner = 2.0 / self.dead_time
            path = path @ system(-corner, 1.0, 2.0 * corner, -1.0)
        return path

    def lag_only(self) -> StateSpace:
        """1 / (lag s + 1)."""
        if self.lag <= 0.0:
            return gain(1.0)
        return system(-1.0 / self.lag, 1.0 / self.lag, 1.0, 0.0)

    def dead_time_at(self, omega: ArrayLike) -> ComplexArray:
        """exp(-j omega dead_time), exactly."""
        return np.asarray(np.exp(-1j * np.asarray(omega, dtype=float) * self.dead_time))


@dataclass(frozen=True)
class GeneralizedPlant:
    """The uncertain body with actuation and weights.

        inputs   w, r, d, n, u         e      = s_r r - x - W_n n
        outputs  z, w_perf, w_u, e     w_perf = W_perf (s_r r - x),   w_u = W_u u,   f = Act u + W_dis d

    d acts as an acceleration (force over the nominal mass). The Coriolis term and the gravity of a wrong mass are part
    of d, as in the paper.
    """

    body: UncertainBody
    weights: Sequence[AxisWeights]
    actuation: Actuation = Actuation()

    def blocks(self, *, real: bool = False) -> Blocks:
        """Structure for the mu of the closed loop: Delta's scalars, real or complex, and a full performance block."""
        q, delta = self.body.q, self.body.blocks()
        return [*(real_scalars(delta) if real else delta), (3 * q, 2 * q)]

    def statespace(self, *, dead_time: bool = True) -> StateSpace:
        """The generalised plant P. The dead time enters as a Pade approximation, or not at all."""
        q, k = self.body.q, self.body.n_delta
        actuation = self.actuation.rational() if dead_time else self.actuation.lag_only()
        parts = [self.body.lft(), append(*[actuation] * q)]
        parts += [append(*(getattr(a, name).statespace() for a in self.weights)) for name in _WEIGHTS]
        blocks = append(*parts)
        # block inputs: w (k), f (q) | u_act (q) | perf (q) | effort (q) | disturbance (q) | noise (q)
        # block outputs: z (k), x (q) | act (q) | perf | effort | disturbance | noise
        one = np.eye(q)
        reference = np.diag([a.reference for a in self.weights])
        at = {name: slice(k + i * q, k + (i + 1) * q) for i, name in enumerate(("body", "act", *_WEIGHTS))}
        v = {name: slice(k + i * q, k + (i + 1) * q) for i, name in enumerate("rdnu")}
        y = {name: slice(k + i * q, k + (i + 1) * q) for i, name in enumerate(("perf", "effort", "e"))}
        n = k + 6 * q
        feedback, entry = np.zeros((n, n)), np.zeros((n, k + 4 * q))
        readout, direct = np.zeros((k + 3 * q, n)), np.zeros((k + 3 * q, k + 4 * q))
        entry[:k, :k] = np.eye(k)
        feedback[at["body"], at["act"]] = one
        feedback[at["body"], at["disturbance"]] = one
        entry[at["act"], v["u"]] = one
        entry[at["effort"], v["u"]] = one
        entry[at["disturbance"], v["d"]] = one
        entry[at["noise"], v["n"]] = one
        entry[at["perf"], v["r"]] = reference
        feedback[at["perf"], at["body"]] = -one
        readout[:k, :k] = np.eye(k)
        readout[y["perf"], at["perf"]] = one
        readout[y["effort"], at["effort"]] = one
        readout[y["e"], at["body"]] = -one
        readout[y["e"], at["noise"]] = -one
        direct[y["e"], v["r"]] = reference
        return interconnect(blocks, feedback, entry, readout, direct)


_WEIGHTS = ("perf", "effort", "disturbance", "noise")
