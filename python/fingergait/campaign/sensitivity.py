"""Which drawn values matter: a measure that takes the campaign's own samples.

Sobol indices need Saltelli's design, which costs (k + 2) N runs for k values, wants independent inputs in a box, and
says little of a rare drop. A campaign passes over impossible objects and draws from balls, so its inputs are dependent.
Hence PAWN: the median, over slices of one value, of the Kolmogorov-Smirnov distance between the figure's distribution
in the slice and that of all runs; 0: the value does not matter. It takes any sample, and a drop's yes or no as well as
an error. A dummy that the runs never saw shows what finite samples make of nothing.
"""

import warnings
from dataclasses import dataclass

import numpy as np
import pyarrow as pa
from numpy.typing import NDArray
from SALib.analyze import pawn

from fingergait.campaign.statistics import column

Array = NDArray[np.float64]

DUMMY = "(dummy)"
_LEAST = 60  # runs under which no measure is worth its ink
_LEAST_DROPS = 8
_RESAMPLES = 20
_SEED = 20
_OUTPUTS = (("position error", "max_position_error_m"), ("orientation error", "max_orientation_error_rad"))


@dataclass(frozen=True)
class Influence:
    """What each drawn value does to one figure, strongest first: `values`, and their 95 % half-widths `spread`."""

    output: str
    names: list[str]
    values: list[float]
    spread: list[float]

    @property
    def noise(self) -> float:
        """The upper end of what the dummy does: what is not clearly above it may be nothing."""
        dummy = self.names.index(DUMMY)
        return self.values[dummy] + self.spread[dummy]


def influences(rows: pa.Table) -> list[Influence]:
    """The influence of every drawn number on the errors and on drops; empty with too few runs."""
    drawn = [field for field in rows.schema if field.name.startswith("x.")]
    names = [field.name for field in drawn if pa.types.is_floating(field.type)]
    inputs = np.column_stack([column(rows, name) for name in names]) if names else np.empty((rows.num_rows, 0))
    # What only some faults have (their force, say) is no input of every run.
    whole = np.isfinite(inputs).all(axis=0) & (np.ptp(np.nan_to_num(inputs), axis=0) > 0.0)
    labels = [name.removeprefix("x.") for name, keep in zip(names, whole, strict=True) if keep] + [DUMMY]
    dummy = np.random.default_rng(_SEED).random((rows.num_rows, 1))
    inputs = np.column_stack([inputs[:, whole], dummy])
    status = np.array(rows.column("status").to_pylist(), dtype=object)
    found = []
    for output, name in _OUTPUTS:
        values = column(rows, name)
        use = (status == "held") & np.isfinite(values)
        if use.sum() >= _LEAST:
            found.append(_influence(output, labels, inputs[use], values[use]))
    ran = status != "error"
    drops = (status == "dropped")[ran].astype(float)
    if ran.sum() >= _LEAST and _LEAST_DROPS <= drops.sum() <= len(drops) - _LEAST_DROPS:
        found.append(_influence("drops", labels, inputs[ran], drops))
    return found


def _influence(output: str, labels: list[str], inputs: Array, values: Array) -> Influence:
    rng = np.random.default_rng(_SEED)
    medians = _pawn(labels, inputs, values)
    again = [rng.integers(len(values), size=len(values)) for _ in range(_RESAMPLES)]
    spread = 1.96 * np.std([_pawn(labels, inputs[pick], values[pick]) for pick in again], axis=0)
    order = np.argsort(-medians)
    return Influence(output, [labels[i] for i in order], medians[order].tolist(), spread[order].tolist())


def _pawn(labels: list[str], inputs: Array, values: Array) -> Array:
    bounds = np.column_stack([inputs.min(axis=0), inputs.max(axis=0)]).tolist()
    problem = {"num_vars": len(labels), "names": labels, "bounds": bounds}
    slices = 4 if len(values) < 200 else 8  # powers of two: SALib's quantiles then end at one exactly
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        found = pawn.analyze(problem, inputs, values, S=slices)
    return np.nan_to_num(np.asarray(found["median"], dtype=np.float64))
