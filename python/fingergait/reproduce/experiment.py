"""An experiment: its runs, its claims and its figures."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field

from matplotlib.figure import Figure

from fingergait.reproduce.case import Case, Outcome
from fingergait.reproduce.claim import Claim

Outcomes = Mapping[str, Outcome]


@dataclass(frozen=True)
class Plot:
    """A figure with its caption."""

    caption: str
    figure: Figure


@dataclass(frozen=True)
class Experiment:
    """A section of the page.

    key, title
        Anchor and heading.
    paper
        Where the paper has it.
    text
        What is done, a few sentences.
    cases
        The runs.
    judge, draw
        The claims and the plots that follow from the outcomes, by case key.
    """

    key: str
    title: str
    paper: str
    text: str
    cases: tuple[Case, ...]
    judge: Callable[[Outcomes], list[Claim]]
    draw: Callable[[Outcomes], list[Plot]] = field(default=lambda outcomes: [])
