"""The step of the robust manipulation controller: the paper's Section V-C.1, Figs. 4 and 5."""

from fingergait.reproduce import figures
from fingergait.reproduce.case import Case, Outcome
from fingergait.reproduce.claim import Claim, share, worst
from fingergait.reproduce.experiment import Experiment, Outcomes, Plot

_MASS, _INERTIA = "truth.mass_scale", "truth.inertia_scale"
_SMALL = {
    "step +20 % mass, +50 % inertia": {_MASS: 1.2, _INERTIA: 1.5},
    "step +20 % mass, -50 % inertia": {_MASS: 1.2, _INERTIA: 0.5},
}
_LARGE = {
    "step -40 % mass, +50 % inertia": {_MASS: 0.6, _INERTIA: 1.5},
    "step -40 % mass, -50 % inertia": {_MASS: 0.6, _INERTIA: 0.5},
    "step +40 % mass, +50 % inertia": {_MASS: 1.4, _INERTIA: 1.5},
}
_DAMPING = {
    "step, 0.1 of the joint damping": {"truth.joint_damping_scale": 0.1},
    "step, 2 times the joint damping": {"truth.joint_damping_scale": 2.0},
}
_HARDWARE = {
    "step, motor lag 15 ms": {"truth.motor_lag_s": 0.015},
    "step, pose noise 0.2 mm, 2 mrad": {"sensors.position_noise": 2e-4, "sensors.orientation_noise": 2e-3},
}
_GRAVITY = {"hold +20 % mass": {_MASS: 1.2}, "hold -40 % mass": {_MASS: 0.6}}


def step() -> Experiment:
    """Settling, overshoot and gravity recovery under uncertainty of mass and inertia."""
    traced = {next(iter(_SMALL)), next(iter(_LARGE))}
    cases = [
        Case(key, "robust-step", overrides, trace=key in traced, film=key == next(iter(_SMALL)))
        for group in (_SMALL, _LARGE, _DAMPING, _HARDWARE)
        for key, overrides in group.items()
    ]
    cases += [Case(key, "hold", overrides) for key, overrides in _GRAVITY.items()]
    return Experiment(
        key="robust-step",
        title="Step of the robust controller",
        paper="Section V-C.1, Figs. 4 and 5",
        text="The desired pose jumps by (4, 4, 10) mm and 0.5 rad about Z with the object standing on the palm. No "
        "finger relocates. The controller believes the nominal mass and inertia.",
        cases=tuple(cases),
        judge=_judge,
        draw=_draw,
    )


def _settling(outcome: Outcome) -> float | None:
    return outcome.metrics["settling_time_s"]["max"] if outcome.kept else None


def _overshoot(outcome: Outcome) -> float | None:
    value = outcome.extra.get("overshoot")
    return None if value is None or not outcome.kept else 100.0 * float(value)


def _judge(outcomes: Outcomes) -> list[Claim]:
    def of(group: dict[str, dict[str, float]]) -> list[Outcome]:
        return [outcomes[key] for key in group]

    moved = of(_SMALL) + of(_LARGE)
    return [
        worst(
            "step-settling-20",
            "Every channel settles to 5 % with +20 % mass and 50 % inertia error",
            of(_SMALL),
            _settling,
            0.7,
            "s",
            "1.1064 s",
        ),
        worst(
            "step-settling-40",
            "Every channel settles to 5 % with 40 % mass and 50 % inertia error",
            of(_LARGE),
            _settling,
            0.8,
            "s",
            "2.2138 s",
        ),
        worst("step-overshoot", "No channel overshoots by more than 15 % of its step", moved, _overshoot, 15.0, "%"),
        worst(
            "gravity-recovery",
            "The gravity mismatch is under 0.5 mm soon after lift-off",
            of(_GRAVITY),
            lambda o: o.extra.get("gravity_recovery_s") if o.kept else None,
            0.5,
            "s",
            "0.5 s",
        ),
        worst("step-damping", "The same with 0.1 to 2 times the joint damping", of(_DAMPING), _settling, 1.5, "s"),
        share(
            "step-hardware",
            "The object is kept with 15 ms of motor lag, and with pose noise of 0.2 mm and 2 mrad",
            of(_HARDWARE),
            lambda o: o.kept,
        ),
    ]


def _draw(outcomes: Outcomes) -> list[Plot]:
    keys = [next(iter(_SMALL)), next(iter(_LARGE))]
    return [
        Plot(
            "Tracking errors after the step (the paper's Fig. 5): position above, orientation below; dots mark the "
            "moment from which a channel stays within 5 % of its step.",
            figures.steps([outcomes[key] for key in keys]),
        )
    ]
