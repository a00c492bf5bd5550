"""Objects whose friction the controller does not know."""

from fingergait.reproduce import figures
from fingergait.reproduce.case import Case, Outcome
from fingergait.reproduce.claim import Claim, share
from fingergait.reproduce.experiment import Experiment, Outcomes, Plot

_FRICTIONS = (0.8, 0.7, 0.6, 0.5)
_MASSES = (0.5, 0.6)  # kg, true; 0.5 kg is believed
_ORIENTATION = 0.05  # rad
_FULL = 6.2  # rad


def slippery(quick: bool) -> Experiment:
    """Full turns at true friction 0.5 to 0.8, unknown to the controller, and holding on at 0.4."""
    seeds = range(1 if quick else 10)
    cases = [
        Case(
            _key(friction, mass, seed),
            "slippery",
            {
                "truth.friction": friction,
                "truth.mass_scale": mass / 0.5,
                "seed": seed,
            },
            trace=seed == 0 and mass == 0.5 and friction == 0.6,
        )
        for friction in _FRICTIONS
        for mass in _MASSES
        for seed in seeds
    ]
    cases += [
        Case(
            f"held at 0.4, {mass:g} kg, seed {seed}",
            "slippery",
            {
                "truth.friction": 0.4,
                "truth.mass_scale": mass / 0.5,
                "duration": 15.0,
                "reference.yaw_rate": 0.0,
                "seed": seed,
            },
        )
        for mass in _MASSES
        for seed in seeds
    ]
    assumed = cases[0].scenario.controller.friction
    return Experiment(
        key="slippery",
        title="Friction that nobody told the controller",
        paper="Section V-C.2, last paragraph (video only)",
        text=f"The controller assumes a friction of {assumed:g} at first and doesn't know the object's. It must notice "
        "the slip from joint angles, contact places and the object's pose, and press harder. Every run has noise "
        "on all sensors.",
        cases=tuple(cases),
        judge=lambda outcomes: _judge(outcomes, seeds),
        draw=lambda outcomes: _draw(outcomes),
    )


def _key(friction: float, mass: float, seed: int) -> str:
    return f"friction {friction:g}, {mass:g} kg, seed {seed}"


def _good(outcome: Outcome) -> bool:
    error = outcome.value("max_orientation_error_rad")
    return error is not None and error <= _ORIENTATION and outcome.turned >= _FULL


def _judge(outcomes: Outcomes, seeds: range) -> list[Claim]:
    claims = [
        share(
            f"slippery-{friction:g}-{mass:g}kg",
            f"True friction {friction:g}, {mass:g} kg: a full turn, never lost, within 0.05 rad",
            [outcomes[_key(friction, mass, seed)] for seed in seeds],
            _good,
        )
        for friction in _FRICTIONS
        for mass in _MASSES
    ]
    held = [outcome for key, outcome in outcomes.items() if key.startswith("held")]
    claims.append(
        share(
            "slippery-0.4-held",
            "True friction 0.4: lifted, and held through the swing for 15 s",
            held,
            lambda o: o.kept,
        )
    )
    return claims


def _draw(outcomes: Outcomes) -> list[Plot]:
    plots = [
        Plot(
            "Every run: how far the object was turned, and the largest orientation error; red runs lost the object.",
            figures.grid([o for key, o in outcomes.items() if key.startswith("friction")]),
        )
    ]
    for key, outcome in outcomes.items():
        if outcome.trace:
            plots.append(
                Plot(f"The friction that the controller assumes, and the errors: {key}.", figures.friction(outcome))
            )
    return plots
