"""Controllers for other rates: what turns at 500 Hz turns at 200, 333 and 1000 as well."""

import pytest

import fingergait as fg
from fingergait import Scenario


def at(name: str, rate: int, **overrides: object) -> fg.Run:
    keys = {"controller.rate_hz": rate, "controller.file": f"mu-{rate}", **overrides}
    return fg.simulate(Scenario.load(name, keys))


@pytest.mark.parametrize("rate", [200, 333, 1000])
def test_an_object_is_lifted_and_turned_at_other_rates(rate: int) -> None:
    run = at("lift-and-rotate", rate, duration=12.0)
    assert run.metrics["completed"], run.metrics["incomplete_reason"]
    assert run.metrics["gaits"] > 3
    assert run.metrics["max_position_error_m"] < 1e-3
    assert run.metrics["max_orientation_error_rad"] < 0.03


@pytest.mark.parametrize("rate", [200, 333, 1000])
def test_pushes_are_resisted_at_other_rates(rate: int) -> None:
    metrics = at("push-at-rest", rate, duration=8.0).metrics
    assert not metrics["dropped"]
    assert metrics["max_position_error_m"] < 5e-3


def test_a_rate_without_a_controller_is_refused_with_the_command_that_makes_one() -> None:
    with pytest.raises(fg.ConfigError, match=r"fingergait synthesize contact --rate 250 --out mu-250\.json"):
        fg.simulate(Scenario.load("hold", {"controller.rate_hz": 250}))
