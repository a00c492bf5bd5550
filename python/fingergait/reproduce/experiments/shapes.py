"""Other shapes with the identical planner: the paper's Section V-C.2, Fig. 10."""

from fingergait.reproduce import figures
from fingergait.reproduce.case import Case
from fingergait.reproduce.claim import Claim, orientation, position, share, worst
from fingergait.reproduce.experiment import Experiment, Outcomes, Plot

_SHAPES = {
    "ellipsoid 26 x 26 x 60 mm": ("ellipsoid", {}),
    "ellipsoid 28 x 24 x 60 mm": ("ellipsoid", {"object.size": [0.028, 0.024, 0.06]}),
    "ellipsoid 27 x 27 x 50 mm": ("ellipsoid", {"object.size": [0.027, 0.027, 0.05]}),
    "cone 27 to 23 mm": ("cone", {}),
}
_MASSES = {"-20 %": 0.8, "+20 %": 1.2}
_FULL = 6.2  # rad: a full turn less what the swing may hide


def shapes() -> Experiment:
    """Three ellipsoids and a truncated cone, lighter and heavier than believed."""
    cases = tuple(
        Case(
            f"{shape}, {label}",
            base,
            {**overrides, "truth.mass_scale": mass},
            trace=shape.startswith("ellipsoid 26") and mass < 1.0,
            film=mass < 1.0 and (shape.startswith("ellipsoid 26") or shape.startswith("cone")),
        )
        for shape, (base, overrides) in _SHAPES.items()
        for label, mass in _MASSES.items()
    )
    return Experiment(
        key="shapes",
        title="Ellipsoids and a cone, the same planner",
        paper="Section V-C.2, Fig. 10",
        text="Three ellipsoids and a truncated cone turn about Z and swing about Y, 20 % lighter and 20 % heavier "
        "than believed. Nothing in the controller changes.",
        cases=cases,
        judge=_judge,
        draw=_draw,
    )


def _judge(outcomes: Outcomes) -> list[Claim]:
    runs = list(outcomes.values())
    claims = [
        share("shapes-kept", "Every shape makes a full turn", runs, lambda o: o.kept and o.turned >= _FULL, "kept")
    ]
    for shape in _SHAPES:
        pair = [outcomes[f"{shape}, {label}"] for label in _MASSES]
        name = shape.replace(" ", "-")
        claims += [
            worst(f"{name}-position", f"Largest position error, {shape}", pair, position, 1.0, "mm"),
            worst(f"{name}-orientation", f"Largest orientation error, {shape}", pair, orientation, 0.020, "rad"),
        ]
    return claims


def _draw(outcomes: Outcomes) -> list[Plot]:
    return [Plot(f"Tracking errors, {key}.", figures.tracking(o)) for key, o in outcomes.items() if o.trace]
