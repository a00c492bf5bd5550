"""The quality rate of relocations, predicted and measured: the paper's Section V-C.2, Fig. 11."""

from fingergait.reproduce import figures
from fingergait.reproduce.case import Case, Outcome
from fingergait.reproduce.claim import Claim, Figure, worst
from fingergait.reproduce.experiment import Experiment, Outcomes, Plot

_KEY = "quality rate"


def quality() -> Experiment:
    """What every relocation does to the grasp quality."""
    return Experiment(
        key="quality-rate",
        title="Each relocation improves the grasp",
        paper="Section V-C.2, Fig. 11",
        text="The paper shows the rate that its linear programme predicts for the free finger's motion. Here "
        "stands beside it the rate of the whole quality, measured from the contacts and the joint angles, "
        "which also counts what the other three fingers lose meanwhile because the object goes on turning.",
        cases=(Case(_KEY, "quality-rate", trace=True),),
        judge=_judge,
        draw=lambda outcomes: [
            Plot(
                "Relocations in the middle of the run (the paper's Fig. 11): quality above; below, the rate that the "
                "programme predicts and the measured rate.",
                figures.relocations(outcomes[_KEY]),
            )
        ],
    )


def _percent(name: str) -> Figure:
    def value(outcome: Outcome) -> float | None:
        found = outcome.extra["gaits"][name]
        return None if found is None else 100.0 * float(found)

    return value


def _exceptions(outcome: Outcome, name: str) -> str:
    """When the gaits began that are not as claimed; a gait in the run's first seconds restores a stale grasp."""
    figures = outcome.extra["gaits"]
    times = [f"{t:.1f}" for t in figures[name]]
    if not times:
        return ""
    shown = ", ".join(times[:6]) + (", ..." if len(times) > 6 else "")
    return f"not so in {len(times)} of {figures['gaits']} gaits, begun at {shown} s"


def _judge(outcomes: Outcomes) -> list[Claim]:
    run = [outcomes[_KEY]]
    return [
        worst(
            "quality-predicted",
            "Share of a slide in which the predicted dQ/dt is positive",
            run,
            lambda o: 100.0 * (o.metrics["qdot_positive_fraction"] or 0.0),
            98.0,
            "%",
            "positive",
            at_least=True,
        ),
        worst(
            "quality-measured",
            "Relocations over which the measured dQ/dt is positive as a whole",
            run,
            _percent("rate_positive"),
            100.0,
            "%",
            at_least=True,
            note=_exceptions(run[0], "falling_at"),
        ),
        worst(
            "quality-raised",
            "Gaits after which Q exceeds Q before",
            run,
            _percent("raised"),
            95.0,
            "%",
            at_least=True,
            note=_exceptions(run[0], "lowered_at"),
        ),
        worst(
            "quality-above",
            "Share of the time between gaits in which Q is above its threshold",
            run,
            _percent("above"),
            95.0,
            "%",
            "kept above",
            at_least=True,
        ),
    ]
