"""The page: one HTML file that needs nothing else."""

from dataclasses import dataclass
from pathlib import Path

import jinja2

from fingergait.files import write_text
from fingergait.reproduce.ablations import CONDITIONS, VARIANTS
from fingergait.reproduce.claim import Claim
from fingergait.reproduce.experiment import Experiment
from fingergait.reproduce.limit_figure import limit_figure
from fingergait.reproduce.limits import Bisection, Limit
from fingergait.reproduce.result import Reproduction, settings_of
from fingergait.reproduce.style import png, svg


@dataclass(frozen=True)
class Picture:
    """An image of the page: caption, and data URI."""

    caption: str
    source: str


@dataclass(frozen=True)
class Section:
    """An experiment with its claims and pictures; `notes` says what picture is missing and why."""

    experiment: Experiment
    claims: list[Claim]
    pictures: list[Picture]
    films: list[Picture]
    notes: list[str]


@dataclass(frozen=True)
class LimitRow:
    """A limit as a row of its table: what held in every seed, what was lost first, why, how, and the command."""

    limit: Limit
    held: str
    lost: str
    reason: str
    end: str = ""
    command: str = ""


def write_page(result: Reproduction, path: Path) -> None:
    """Writes the page."""
    loader = jinja2.PackageLoader("fingergait.reproduce", "templates")
    environment = jinja2.Environment(
        loader=loader,
        autoescape=True,
        undefined=jinja2.StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    environment.filters |= {"figure": figure, "milli": milli, "percent": percent}
    claims = result.all_claims
    text = environment.get_template("page.html").render(
        result=result,
        claims=claims,
        held=sum(claim.held for claim in claims),
        sections=[_section(experiment, result) for experiment in result.experiments],
        limit_picture=svg(limit_figure(result.limits, result.bisections)),
        limits=[limit_row(limit, result.bisections[limit.key]) for limit in result.limits],
        variants=VARIANTS,
        conditions=list(CONDITIONS),
        settings=settings_of(result),
    )
    write_text(path, text)


def _section(experiment: Experiment, result: Reproduction) -> Section:
    outcomes = {case.key: result.outcomes[case.key] for case in experiment.cases}
    return Section(
        experiment=experiment,
        claims=result.claims[experiment.key],
        pictures=[Picture(plot.caption, svg(plot.figure)) for plot in experiment.draw(outcomes)],
        films=[
            Picture(f"{key[:1].upper()}{key[1:]}, from the front and from the top.", png(outcome.film))
            for key, outcome in outcomes.items()
            if outcome.film is not None
        ],
        notes=sorted({outcome.note for outcome in outcomes.values() if outcome.note}),
    )


def limit_row(limit: Limit, bisections: list[Bisection]) -> LimitRow:
    """The row of a limit: the value that every seed held, and the mildest that some seed lost."""
    harder = 1.0 if limit.hard > limit.easy else -1.0
    held = [b.held for b in bisections if b.held is not None]
    lost = [b for b in bisections if b.lost is not None]
    unit = f" {limit.unit}" if limit.unit else ""
    if not lost:
        return LimitRow(limit, f"{limit.hard:g}{unit}", f"beyond {limit.hard:g}{unit}", "no limit found in the range")
    first = min(lost, key=lambda b: harder * (b.lost if b.lost is not None else 0.0))
    trial = next(trial for trial in first.trials if trial.value == first.lost)
    kept = f"{min(held, key=lambda value: harder * value):g}{unit}" if len(held) == len(bisections) else "none"
    return LimitRow(limit, kept, f"{first.lost:g}{unit}", trial.reason, trial.end, trial.command)


def figure(value: float | None) -> str:
    """A number with three digits, or "lost"."""
    if value is None:
        return "lost"
    if value == 0.0 or 0.001 <= abs(value) < 10000.0:
        return f"{value:.3g}" if abs(value) < 1000.0 else f"{value:.0f}"
    return f"{value:.2e}"


def milli(value: float | None, digits: int = 2) -> str:
    """A number in thousandths."""
    return "–" if value is None else f"{1e3 * value:.{digits}f}"


def percent(value: float | None) -> str:
    """A share in percent."""
    return "–" if value is None else f"{100.0 * value:.0f}"
