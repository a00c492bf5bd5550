"""The reproduction: commands that repeat a run, verdicts, gaits, the first active constraint and bisection."""

import shlex
from typing import Any

import numpy as np
import pytest
from typer.testing import CliRunner

from fingergait.cli import app
from fingergait.reproduce import limits
from fingergait.reproduce.ablations import CONDITIONS, VARIANTS, ablation_cases
from fingergait.reproduce.analysis import analyse
from fingergait.reproduce.case import Case, Outcome, full_turn, toml
from fingergait.reproduce.claim import share, worst
from fingergait.reproduce.constraint import explain
from fingergait.reproduce.experiments import all_experiments
from fingergait.reproduce.gaits import completed_gaits, gait_figures, measured_rate
from fingergait.reproduce.limits import Limit, Trial, bisect
from fingergait.reproduce.pool import run_case, run_jobs
from fingergait.run.log import Log
from fingergait.scenario import Scenario, parse_override


def scenario_of(command: str) -> Scenario:
    """The scenario that a command line runs, read as the command line would be."""
    words = iter(shlex.split(command)[2:])
    base, overrides = next(words), {}
    for word in words:
        if word == "--no-gait":
            overrides["gait.enabled"] = False
        elif word == "--set":
            key, value = parse_override(next(words))
            overrides[key] = value
        else:
            key, value = parse_override(f"{word.removeprefix('--')}={next(words)}")
            overrides[key] = value
    return Scenario.load(base, overrides)


@pytest.mark.parametrize("quick", [True, False])
def test_every_command_repeats_its_run_exactly(quick: bool) -> None:
    cases = [case for experiment in all_experiments(quick) for case in experiment.cases]
    for case in [*cases, *ablation_cases(quick)]:
        assert scenario_of(case.command) == case.scenario, case.command


@pytest.mark.parametrize("limit", limits.all_limits(), ids=lambda limit: limit.key)
def test_both_ends_of_every_limit_are_valid_scenarios(limit: Limit) -> None:
    for value in (limit.easy, limit.hard):
        case = Case("end", "noisy", {"duration": limit.duration(value), **limit.keys(value)})
        assert scenario_of(case.command) == case.scenario


@pytest.mark.parametrize("quick", [True, False])
def test_names_are_unique(quick: bool) -> None:
    experiments = all_experiments(quick)
    keys = [case.key for experiment in experiments for case in experiment.cases]
    assert len(set(keys)) == len(keys)
    assert len({experiment.key for experiment in experiments}) == len(experiments)
    removed = [case.key for case in ablation_cases(quick)]
    assert len(set(removed)) == len(removed) >= len(VARIANTS) * len(CONDITIONS)


def test_a_full_turn_leaves_time_for_the_lift_and_the_blend() -> None:
    for rate in (0.2, -0.4, 0.9):
        reference = Scenario.load("lift-and-rotate", {"reference.yaw_rate": rate}).reference
        turned = abs(rate) * (full_turn(rate) - reference.motion_start - 0.5 * reference.blend)
        assert 2.0 * np.pi < turned < 2.0 * np.pi + 0.4


def test_values_are_written_as_toml() -> None:
    assert toml([0.1, -2.0, True, "x", [3]]) == '[0.1, -2.0, true, "x", [3]]'


def outcome(key: str, error: float | None, turned: float = 7.0) -> Outcome:
    metrics: dict[str, Any] = {
        "dropped": error is None,
        "lost_reason": "slid away" if error is None else None,
        "max_position_error_m": error,
        "max_orientation_error_rad": error,
        "rotation_rad": turned,
    }
    return Outcome(Case(key, "hold", {"seed": len(key)}), metrics, {})


def test_a_claim_is_judged_by_its_worst_run() -> None:
    runs = [outcome("a", 0.1), outcome("bb", 0.3), outcome("ccc", 0.2)]
    claim = worst("n", "c", runs, lambda o: o.value("max_position_error_m"), 0.25)
    assert (claim.measured, claim.held, claim.command) == (0.3, False, "fingergait run hold --seed 2")
    assert worst("n", "c", runs, lambda o: o.value("max_position_error_m"), 0.3).held
    least = worst("n", "c", runs, lambda o: o.value("max_position_error_m"), 0.1, at_least=True)
    assert (least.measured, least.held) == (0.1, True)


def test_a_lost_run_is_worse_than_any_figure() -> None:
    for at_least in (False, True):
        runs = [outcome("a", 0.1), outcome("bb", None)]
        claim = worst("n", "c", runs, lambda o: o.value("max_position_error_m"), 1e9, at_least=at_least)
        assert claim.measured is None
        assert not claim.held
        assert claim.note == "slid away"


def test_a_share_counts_good_runs_and_says_what_went_wrong() -> None:
    runs = [outcome("good", 0.01), outcome("bad", 0.2), outcome("lost", None)]
    claim = share("n", "c", runs, lambda o: o.kept and o.metrics["max_orientation_error_rad"] < 0.1)
    assert (claim.measured, claim.limit, claim.unit, claim.held) == (1.0, 3.0, "of 3 runs", False)
    assert claim.note == "bad: kept and turned by 401 degrees with errors up to 200.00 mm and 0.200 rad"
    assert share("n", "c", runs[:1], lambda o: o.kept).held


def gait_log() -> Log:
    """Two gaits of 0.2 s, with slides of 0.1 s: the first raises Q by 2, the second lowers it by 1."""
    names = ["Q", "threshold", "free_finger", "gaits", "phase"]
    log = Log(names, ["f0"])
    for k in range(1000):
        t = 1e-3 * k
        free, gaits, phase, quality = -1.0, 0.0, 0.0, 5.0
        for number, (begin, finger, gain) in enumerate(((0.2, 2.0, 2.0), (0.6, 0.0, -1.0)), start=1):
            if t >= begin:
                gaits = number
                quality += gain * min(1.0, max(0.0, (t - begin - 0.05) / 0.1))
            if begin <= t < begin + 0.2:
                free, phase = finger, 2.0 if 0.05 <= t - begin < 0.15 else 1.0
        log.append(t)[:] = (quality, 5.5, free, gaits, phase)
    return log


def test_gaits_are_found_with_what_they_did_to_the_quality() -> None:
    log = gait_log()
    first, second = completed_gaits(log)
    assert (first.finger, second.finger) == (2, 0)
    assert (first.before, first.after, second.before, second.after) == (5.0, 7.0, 7.0, 6.0)
    assert first.rate == pytest.approx(20.0, rel=0.02)
    assert second.rate == pytest.approx(-10.0, rel=0.02)
    figures = gait_figures(log, 0.0)
    assert figures["gaits"] == 2
    assert figures["raised"] == figures["rate_positive"] == 0.5
    assert figures["resting"] == pytest.approx(0.6, abs=0.01)
    assert figures["above"] == pytest.approx(2.0 / 3.0, abs=0.01)
    assert gait_figures(log, 0.9)["raised"] is None


def test_the_measured_rate_is_the_derivative() -> None:
    t = np.arange(0.0, 1.0, 0.002)
    rate = measured_rate(t, t**3)
    inner = np.isfinite(rate)
    assert inner.sum() > 480
    assert np.allclose(rate[inner], 3.0 * t[inner] ** 2, atol=2e-4)


def test_a_run_without_gaits_names_the_joint_or_torque_limit_that_came_first() -> None:
    lost = run_case(Case("x", "lift-and-rotate", {"duration": 60.0, "gait.enabled": False}))
    assert not lost.kept
    constraints = lost.extra["constraints"]
    times = [item["at_s"] for item in constraints]
    assert times == sorted(times)
    assert constraints[0]["name"] in {"joint", "torque"}
    assert "limit at" in explain(constraints)
    assert explain([]).startswith("no limit")


def test_analysis_of_a_quiet_hold_finds_nothing_active() -> None:
    held = run_case(Case("x", "hold", {"duration": 2.0}))
    assert held.extra["constraints"] == []
    assert held.extra["gravity_recovery_s"] < 0.5
    assert held.extra["overshoot"] is None
    assert held.extra["pulses"] == []


def test_a_value_that_the_hand_cannot_start_with_is_beyond_the_limit() -> None:
    limit = Limit("k", "k", "", "", 25.0, 300.0, lambda v: {"object.size": [1e-3 * v, 0.06]}, lambda v: 0.1)
    found = bisect(limit, 0, 1)
    assert found.held is not None and found.held < 300.0
    assert found.trials[1].reason == "the hand can't start with it"
    assert "can touch" in found.trials[1].end


@pytest.mark.parametrize("geometric", [True, False])
@pytest.mark.parametrize(("easy", "hard"), [(1.0, 9.0), (9.0, 1.0)])
def test_bisection_encloses_the_true_limit(
    geometric: bool, easy: float, hard: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    true = 3.3
    monkeypatch.setattr(
        limits, "_trial", lambda limit, value, seed: Trial(value, (value < true) == (easy < hard), "", "", "")
    )
    limit = Limit("k", "k", "", "", easy, hard, lambda v: {}, lambda v: 1.0, geometric)
    found = bisect(limit, 0, 8)
    assert found.held is not None and found.lost is not None
    low, high = sorted((found.held, found.lost))
    assert low <= true <= high
    assert high - low < 0.05
    assert len(found.trials) == 10


def test_bisection_says_when_an_end_is_not_as_expected(monkeypatch: pytest.MonkeyPatch) -> None:
    limit = Limit("k", "k", "", "", 1.0, 2.0, lambda v: {}, lambda v: 1.0)
    for held, expected in ((True, (2.0, None)), (False, (None, 1.0))):
        monkeypatch.setattr(limits, "_trial", lambda limit, value, seed, held=held: Trial(value, held, "", "", ""))
        found = bisect(limit, 0, 5)
        assert (found.held, found.lost) == expected


def test_jobs_come_back_in_order_whatever_the_workers() -> None:
    jobs = [(f"job {k}", float(k), abs, (-k,)) for k in range(5)]
    assert run_jobs(jobs, 1, quiet=True) == run_jobs(jobs, 2, quiet=True) == [0, 1, 2, 3, 4]


def test_a_folder_that_cannot_be_written_is_bad_input(tmp_path: Any) -> None:
    (tmp_path / "file").write_text("")
    result = CliRunner().invoke(app, ["reproduce", "--out", str(tmp_path / "file")])
    assert "--out: expected a folder" in str(result.exception)


def test_analysis_measures_the_pulses() -> None:
    scenario = Case("x", "push-at-rest", {"duration": 5.0}).scenario
    import fingergait as fg

    pulses = analyse(fg.simulate(scenario).log, scenario)["pulses"]
    assert 2e-4 < pulses[0]["position_m"] < 5e-3
    assert not pulses[0]["in_gait"]
    assert pulses[-1]["position_m"] is None
