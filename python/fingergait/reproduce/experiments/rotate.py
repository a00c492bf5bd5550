"""Lift and rotate, with and without the gait planner: the paper's Section V-C.2, Figs. 6 and 7."""

from fingergait.reproduce import figures
from fingergait.reproduce.case import Case, Outcome
from fingergait.reproduce.claim import Claim, orientation, position, worst
from fingergait.reproduce.experiment import Experiment, Outcomes, Plot

_WITH, _WITHOUT, _BACK = "with the planner", "without the planner", "the other way round"


def rotate(quick: bool) -> Experiment:
    """A long rotation in both directions, and the same without gaits."""
    duration = 60.0 if quick else 600.0
    base = "lift-and-rotate"
    return Experiment(
        key=base,
        title="Lift and rotate without end",
        paper="Section V-C.2, Figs. 6 and 7",
        text="Up by 11 mm, round Z at 0.2 rad/s without end, and to and fro about Y with 0.1 rad at 4 rad/s. The "
        "object is 20 % heavier than believed and has 50 % more inertia.",
        cases=(
            Case(_WITH, base, {"duration": duration}, trace=True, film=True),
            Case(_WITHOUT, base, {"duration": 60.0, "gait.enabled": False}, trace=True, film=True),
            Case(_BACK, base, {"duration": 36.0, "reference.yaw_rate": -0.2}),
        ),
        judge=lambda outcomes: _judge(outcomes, duration),
        draw=_draw,
    )


def _judge(outcomes: Outcomes, duration: float) -> list[Claim]:
    kept, lost, back = outcomes[_WITH], outcomes[_WITHOUT], outcomes[_BACK]
    return [
        worst(
            "rotate-kept",
            "The object turns without a drop",
            [kept],
            lambda o: o.value("duration_s"),
            duration - 0.01,
            "s",
            "seconds",
            at_least=True,
        ),
        worst("rotate-position", "Largest position error while turning", [kept], position, 1.0, "mm", "3.7 mm"),
        worst(
            "rotate-orientation",
            "Largest orientation error while turning",
            [kept],
            orientation,
            0.015,
            "rad",
            "0.027 rad",
        ),
        worst("rotate-heights", "The mean contact height does not drift", [kept], _drift, 1.0, "mm"),
        worst(
            "rotate-without-planner",
            "Without the planner the object is lost before 180 degrees",
            [lost],
            _lost_at,
            180.0,
            "degrees",
            "90 degrees",
        ),
        worst("rotate-both-ways", "It turns the other way round as well", [back], orientation, 0.015, "rad"),
        worst(
            "step-time",
            "Mean time of a control step in the compiled core",
            [kept],
            lambda o: o.metrics["step_us"]["mean"],
            1000.0,
            "µs",
            "< 1 ms",
        ),
    ]


def _drift(outcome: Outcome) -> float | None:
    drift = outcome.extra.get("height_drift_m")
    return None if drift is None or not outcome.kept else 1e3 * abs(float(drift))


def _lost_at(outcome: Outcome) -> float | None:
    return 57.29577951308232 * outcome.turned if outcome.metrics.get("dropped") else None


def _draw(outcomes: Outcomes) -> list[Plot]:
    return [
        Plot("Tracking errors with the planner (the paper's Fig. 7).", figures.tracking(outcomes[_WITH])),
        Plot(
            "Grasp quality with its threshold, gaits shaded by finger, and the heights of the contacts on the object.",
            figures.quality(outcomes[_WITH]),
        ),
        Plot("Tracking errors without the planner.", figures.tracking(outcomes[_WITHOUT])),
    ]
