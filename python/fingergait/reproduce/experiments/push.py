"""Pulses of force and torque in every direction: the paper's Section V-C.2, Fig. 9."""

from fingergait.reproduce import figures
from fingergait.reproduce.case import Case, Outcome
from fingergait.reproduce.claim import Claim, share, worst
from fingergait.reproduce.experiment import Experiment, Outcomes, Plot

_TURNING, _REST, _HARD, _HARD_REST = "push while turning", "push at rest", "8 N while turning", "8 N at rest"
_SHIFTS = (1.0, 1.25, 1.5, 1.75)  # s: when the motion begins, so that the pulses meet the gaits elsewhere


def push(quick: bool) -> Experiment:
    """5 N and 0.03 N m in twelve directions, 8 N in six, while turning and at rest."""
    shifts = _SHIFTS[:2] if quick else _SHIFTS
    hard = [
        Case(_hard(shift), "push-hard", {} if shift == 1.0 else {"reference.motion_at": shift}, trace=shift == 1.0)
        for shift in shifts
    ]
    cases = (
        Case(_TURNING, "push", trace=True),
        Case(_REST, "push-at-rest", trace=True),
        *hard,
        Case(_HARD_REST, "push-hard-at-rest"),
    )
    return Experiment(
        key="push",
        title="Pushes from every side",
        paper="Section V-C.2, Fig. 9",
        text="Pulses of 0.2 s on the object in all axes and both signs: 5 N and 0.03 N m, then 8 N. Recovery is "
        "counted from the end of a pulse until the error it caused is back at the level before it plus 10 % "
        "of its peak.",
        cases=cases,
        judge=lambda outcomes: _judge(outcomes, [_hard(shift) for shift in shifts]),
        draw=_draw,
    )


def _hard(shift: float) -> str:
    return f"{_HARD}, motion from {shift:g} s"


def _recovery(outcome: Outcome) -> float | None:
    times = outcome.metrics["recovery_time_s"]
    return None if not outcome.kept or None in times else float(max(times))


def _peak(outcome: Outcome) -> float | None:
    peaks = [pulse["position_m"] for pulse in outcome.extra["pulses"]]
    return None if not outcome.kept or None in peaks else 1e3 * float(max(peaks))


def _each(outcome: Outcome) -> str:
    """The recovery after each pulse."""
    names = [f"{sign}{axis}" for axis in "xyz" for sign in "+-"]
    times = ["never" if t is None else f"{t:.2f}" for t in outcome.metrics["recovery_time_s"]]
    pairs = [f"{name} {time}" for name, time in zip(names * 2, times, strict=True)]
    return f"forces: {', '.join(pairs[:6])} s; torques: {', '.join(pairs[6:])} s"


def _judge(outcomes: Outcomes, hard: list[str]) -> list[Claim]:
    turning, rest = outcomes[_TURNING], outcomes[_REST]
    strong = [outcomes[key] for key in hard]
    met = sum(pulse["in_gait"] for outcome in strong for pulse in outcome.extra["pulses"])
    total = sum(len(outcome.extra["pulses"]) for outcome in strong)
    claims = [
        share(
            "push-kept",
            "5 N and 0.03 N m in twelve directions: never lost, turning and at rest",
            [turning, rest],
            lambda o: o.kept,
            "kept",
        ),
        worst(
            "push-recovery-turning",
            "The error is gone soon after the pulse, while turning",
            [turning],
            _recovery,
            0.5,
            "s",
            "0.5 s",
            note=_each(turning),
        ),
        worst(
            "push-recovery-rest",
            "The error is gone soon after the pulse, at rest",
            [rest],
            _recovery,
            0.5,
            "s",
            "0.5 s",
            note=_each(rest),
        ),
        worst("push-peak", "Largest position error that a pulse causes", [turning, rest], _peak, 3.0, "mm"),
        share(
            "push-8-turning",
            f"8 N in all directions while turning: not lost ({met} of {total} pulses met a gait)",
            strong,
            lambda o: o.kept,
        ),
        share("push-8-rest", "8 N in all directions at rest: not lost", [outcomes[_HARD_REST]], lambda o: o.kept),
    ]
    return claims


def _draw(outcomes: Outcomes) -> list[Plot]:
    return [
        Plot(
            "Response while turning (the paper's Fig. 9): forces and position errors, torques and orientation errors.",
            figures.pushes(outcomes[_TURNING]),
        ),
        Plot("Response at rest.", figures.pushes(outcomes[_REST])),
    ]
