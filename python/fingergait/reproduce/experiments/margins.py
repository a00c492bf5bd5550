"""Faster, bigger, noisier, further: what lies past the paper and must hold."""

from fingergait.reproduce import figures
from fingergait.reproduce.case import Case, Outcome, full_turn
from fingergait.reproduce.claim import Claim, share, worst
from fingergait.reproduce.claim import orientation as orientation_of
from fingergait.reproduce.experiment import Experiment, Outcomes, Plot

_FULL = 6.2  # rad
_BASE = "noisy"
_FAST, _BIG, _ALL, _SWING = "0.4 rad/s", "radius 33 mm", "all at once", "swing of 0.2 rad"


def margins(quick: bool) -> Experiment:
    """0.4 rad/s, 33 mm, all errors at once and a wide swing, each for a full turn."""
    seeds = range(2 if quick else 10)
    turn = full_turn(0.2)
    cases = []
    for seed in seeds:
        cases.append(
            Case(
                f"{_FAST}, seed {seed}",
                _BASE,
                {"reference.yaw_rate": 0.4, "duration": full_turn(0.4), "seed": seed},
            )
        )
        cases.append(
            Case(f"{_BIG}, seed {seed}", _BASE, {"object.size": [0.033, 0.06], "duration": turn, "seed": seed})
        )
        for sign, scale in (("+", 1.2), ("-", 0.8)):
            cases.append(
                Case(
                    f"{_ALL}, {sign}20 % mass, seed {seed}",
                    "all-at-once",
                    {"truth.mass_scale": scale, "seed": seed},
                    trace=seed == 0 and scale > 1.0,
                )
            )
    cases.append(Case(_SWING, "lift-and-rotate", {"reference.swing_amplitude": 0.2, "duration": turn}, trace=True))
    return Experiment(
        key="margins",
        title="Faster, bigger, noisier",
        paper="past the paper",
        text="A full turn each. At 0.4 rad/s and with a radius of 33 mm every sensor has noise (0.1 mm, 0.1 "
        "degree, contact place 0.3 mm, force 5 %). All at once: 20 % mass error, pose noise of 0.2 mm and 0.2 "
        "degree, 10 ms of pose delay and the tactile noise.",
        cases=tuple(cases),
        judge=_judge,
        draw=_draw,
    )


def _good(outcome: Outcome) -> bool:
    return outcome.kept and outcome.turned >= _FULL


def _judge(outcomes: Outcomes) -> list[Claim]:
    def of(prefix: str) -> list[Outcome]:
        return [outcome for key, outcome in outcomes.items() if key.startswith(prefix)]

    swing = outcomes[_SWING]
    return [
        share("fast", "0.4 rad/s: a full turn, never lost", of(_FAST), _good),
        share("big", "Radius 33 mm with the same hand: a full turn, never lost", of(_BIG), _good),
        share("all-at-once", "All errors at once: a full turn, never lost", of(_ALL), _good),
        share("swing", "A full turn while the swing has an amplitude of 0.2 rad", [swing], _good),
        worst("swing-orientation", "Largest orientation error in it", [swing], orientation_of, 0.05, "rad"),
    ]


def _draw(outcomes: Outcomes) -> list[Plot]:
    plots = [
        Plot(
            "Every run: how far the object was turned, and the largest orientation error.",
            figures.grid(list(outcomes.values())),
        )
    ]
    return plots + [Plot(f"Tracking errors, {key}.", figures.tracking(o)) for key, o in outcomes.items() if o.trace]
