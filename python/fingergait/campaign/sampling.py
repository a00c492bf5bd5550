"""From a campaign's spec to its scenarios: sample i is a pure function of (spec, seed, i)."""

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import product
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.stats import qmc

from fingergait._core import ConfigError
from fingergait.campaign.draw import Draw
from fingergait.campaign.spec import CampaignSpec, FaultDraw
from fingergait.scenario import Scenario
from fingergait.sim.scene import true_inertia

Array = NDArray[np.float64]

_BLOCK = 256  # points drawn at once: a power of two, as Sobol points want
_PATIENCE = 20_000  # impossible points in a row after which there is none to be found


@dataclass(frozen=True)
class Sample:
    """One run to do.

    `overrides`: scenario keys and values on top of the spec's own `set`, the seed among them; `drawn`: the drawn values
    by column; `fault`: label and promise of the injected fault, if any.
    """

    index: int
    overrides: dict[str, Any]
    drawn: dict[str, Any]
    fault: tuple[str, str] | None


class Sampler:
    """The samples of a campaign, in order.

    Points whose true object no body can have (a moment of inertia above the other two together) are passed over, so
    that the kept points fill the possible part of the box evenly; `skipped` counts them.

    Raises
    ------
    ConfigError
        Where a key, an element or a value doesn't fit the scenario.
    """

    def __init__(self, spec: CampaignSpec) -> None:
        self.spec = spec
        self.base = spec.base()
        self._present = self.base.model_dump(mode="json")
        self._draws = [Draw.parse(name, distribution) for name, distribution in spec.vary.items()]
        self._faults = [_fault_draws(fault) for fault in spec.fault]
        self._width = sum(draw.width for draw in self._draws)
        if self._faults:
            self._width += 1 + max(sum(draw.width for draw in draws) for draws in self._faults)
        self.skipped = 0

    @property
    def columns(self) -> dict[str, bool]:
        """Names of the drawn values, each with whether it is a number."""
        draws = [*self._draws, *(draw for draws in self._faults for draw in draws)]
        names: dict[str, bool] = {}
        for draw in draws:
            for column in draw.columns:
                names[column] = names.get(column, True) and draw.distribution.numeric
        return names

    def __iter__(self) -> Iterator[Sample]:
        """The samples from index 0 on: as many as the spec says, or as the grid has."""
        index = refused = 0
        self.skipped = 0
        for u in self._points():
            if self.spec.method != "grid" and index == self.spec.samples:
                return
            sample = self._sample(index, u)
            if sample is None:
                self.skipped, refused = self.skipped + 1, refused + 1
                if refused == _PATIENCE:
                    raise ConfigError(f"vary: expected objects that can exist, found none in {_PATIENCE} points")
                continue
            index, refused = index + 1, 0
            yield sample

    def _points(self) -> Iterator[Array]:
        """Points of the unit cube; of a grid all, otherwise without end."""
        if self.spec.method == "grid":
            axes = [_levels(draw) for draw in self._draws for _ in range(draw.width)]
            yield from (np.array(point) for point in product(*axes))
            return
        rng = np.random.default_rng(self.spec.seed)
        engine = qmc.Sobol(self._width, scramble=True, seed=rng) if self.spec.method == "sobol" else None
        while True:
            yield from engine.random(_BLOCK) if engine is not None else rng.random((_BLOCK, self._width))

    def _sample(self, index: int, u: Array) -> Sample | None:
        seed = int(np.random.SeedSequence([self.spec.seed, index]).generate_state(1)[0])
        overrides: dict[str, Any] = {"seed": seed}
        drawn: dict[str, Any] = {}
        used = 0
        for draw in self._draws:
            values = draw.values(u[used : used + draw.width])
            draw.assign(values, overrides, _present(self._present, draw.key))
            drawn |= zip(draw.columns, values, strict=True)
            used += draw.width
        fault = None
        if self._faults:
            which = min(int(u[used] * len(self._faults)), len(self._faults) - 1)
            described = self.spec.fault[which]
            table = dict(described.constants)
            used += 1
            for draw in self._faults[which]:
                values = draw.values(u[used : used + draw.width])
                key = draw.key.removeprefix("fault.")
                own: dict[str, Any] = {draw.key: table[key]} if key in table else {}
                draw.assign(values, own, None)
                table[key] = own[draw.key]
                drawn |= zip(draw.columns, values, strict=True)
                used += draw.width
            overrides["fault"] = [*self._present["fault"], table]
            fault = described.label, described.promise
        try:
            scenario = self.base.replace(overrides)
        except ConfigError as error:
            raise ConfigError(f"sample {index}: {error}") from None
        return Sample(index, overrides, drawn, fault) if _possible(scenario) else None


def _fault_draws(fault: FaultDraw) -> list[Draw]:
    return [Draw.parse(f"fault.{name}", distribution) for name, distribution in fault.drawn.items()]


def _levels(draw: Draw) -> list[float]:
    """Probabilities of a grid's values: the ends of a range are among them, each item of a choice once."""
    n = draw.distribution.count
    if draw.distribution.choice is not None or draw.distribution.integers is not None:
        return [(i + 0.5) / n for i in range(n)]
    return [i / (n - 1) for i in range(n)]


def _present(values: dict[str, Any], key: str) -> Any:
    """What the scenario has under a dotted key, None where it has nothing."""
    node: Any = values
    for part in key.split("."):
        if not isinstance(node, dict):
            return None
        node = node.get(part)
    return node


def _possible(scenario: Scenario) -> bool:
    try:
        true_inertia(scenario)
    except ConfigError:
        return False
    return True
