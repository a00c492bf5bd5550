"""A campaign's samples: pure functions of spec, seed and index; distributions against scipy; bad specs in one line."""

import itertools
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy import stats

from fingergait._core import ConfigError
from fingergait.campaign.distributions import Distribution
from fingergait.campaign.replay import replay, toml
from fingergait.campaign.sampling import Sample, Sampler
from fingergait.campaign.spec import CampaignSpec
from fingergait.paths import MODELS
from fingergait.scenario import Scenario, parse_override

SPEC = """
scenario = "lift-and-rotate"
samples = 40
seed = 3

[set]
duration = 1.0

[vary]
"truth.mass_scale" = { uniform = [0.6, 1.4] }
"truth.inertia_scale[0:3]" = { uniform = [0.5, 1.5] }
"truth.first_grasp[3]" = { normal = [0.0, 0.05], within = [-0.1, 0.1] }
"truth.com_offset[0:3]" = { ball = 0.004 }
"truth.finger_offset_deg[1]" = { choice = [-3.0, 3.0] }
sensors.pose_rate_hz = { log_uniform = [60.0, 500.0] }
sensors.encoder_bits = { integers = [12, 14] }
"controller.file" = { choice = ["mu", "pid"] }

[[fault]]
kind = "pose_jump"
shift = [0.0, 0.0, 0.0, 0.0, 0.0, 0.2]
"shift[0:2]" = { ball = 0.01 }
at = { uniform = [1.0, 5.0] }

[[fault]]
kind = "tactile_lost"
label = "numb"
promise = "hold"
finger = { integers = [0, 3] }
at = 2.0
"""


def spec_of(folder: Path, text: str, samples: int | None = None) -> CampaignSpec:
    path = folder / "case.toml"
    path.write_text(text)
    return CampaignSpec.load(path, samples)


def samples_of(folder: Path, text: str, count: int) -> list[Sample]:
    return list(Sampler(spec_of(folder, text, count)))


@pytest.mark.parametrize("method", ["sobol", "random"])
def test_a_sample_depends_on_spec_seed_and_index_alone(tmp_path: Path, method: str) -> None:
    text = SPEC.replace("samples = 40", f'samples = 40\nmethod = "{method}"')
    long = samples_of(tmp_path, text, 40)
    assert long[:10] == samples_of(tmp_path, text, 10)
    assert [sample.index for sample in long] == list(range(40))
    assert len({sample.overrides["seed"] for sample in long}) == 40
    other = samples_of(tmp_path, text.replace("seed = 3", "seed = 4"), 10)
    assert all(a.drawn != b.drawn for a, b in zip(long, other, strict=False))


def test_values_land_in_the_scenario_they_belong_to(tmp_path: Path) -> None:
    spec = spec_of(tmp_path, SPEC)
    kinds = set()
    for sample in Sampler(spec):
        scenario = spec.base().replace(sample.overrides)
        drawn, truth = sample.drawn, scenario.truth
        assert truth.mass_scale == drawn["truth.mass_scale"]
        assert list(truth.inertia_scale) == [drawn[f"truth.inertia_scale[{i}]"] for i in range(3)]  # type: ignore[arg-type]
        assert truth.first_grasp == (0.0, 0.0, 0.0, drawn["truth.first_grasp[3]"], 0.0, 0.0)
        assert np.linalg.norm(truth.com_offset) <= 0.004
        assert truth.finger_offset_deg[1] in (-3.0, 3.0)
        assert scenario.sensors.encoder_bits in (12, 13, 14)
        assert scenario.controller.file == drawn["controller.file"]
        assert scenario.duration == 1.0
        (fault,) = scenario.fault
        kinds.add(sample.fault)
        if sample.fault == ("pose_jump", "none"):
            assert 1.0 <= fault.at <= 5.0
            assert fault.shift[2:] == (0.0, 0.0, 0.0, 0.2)
            assert np.hypot(*fault.shift[:2]) <= 0.01
        else:
            assert fault.finger == drawn["fault.finger"]
    assert kinds == {("pose_jump", "none"), ("numb", "hold")}


def test_impossible_objects_are_passed_over_evenly(tmp_path: Path) -> None:
    text = 'scenario = "hold"\n[vary]\n"truth.inertia_scale[0:3]" = { uniform = [0.5, 1.5] }\n'
    sampler = Sampler(spec_of(tmp_path, text, 512))
    drawn = np.array([list(sample.drawn.values()) for sample in sampler])
    moments = drawn * Scenario.load("hold").object.geometry.inertia(0.5)
    assert (2.0 * moments.max(axis=1) <= moments.sum(axis=1)).all()
    assert sampler.skipped > 0
    # The kept share is the volume of the possible part of the box, here by plain random points.
    points = np.random.default_rng(0).uniform(0.5, 1.5, (100_000, 3)) * Scenario.load("hold").object.geometry.inertia(
        0.5
    )
    volume = (2.0 * points.max(axis=1) <= points.sum(axis=1)).mean()
    assert 512 / (512 + sampler.skipped) == pytest.approx(volume, abs=0.02)


def test_a_grid_visits_every_combination_with_both_ends(tmp_path: Path) -> None:
    text = 'scenario = "hold"\nmethod = "grid"\n[vary]\n"truth.friction" = { uniform = [0.5, 1.0], levels = 3 }\n'
    text += '"truth.mass_scale" = { choice = [0.6, 1.0, 1.2, 1.4] }\n'
    drawn = [tuple(sample.drawn.values()) for sample in Sampler(spec_of(tmp_path, text))]
    assert drawn == list(itertools.product([0.5, 0.75, 1.0], [0.6, 1.0, 1.2, 1.4]))


@pytest.mark.parametrize(
    ("values", "reference"),
    [
        ({"uniform": (2.0, 3.0)}, stats.uniform(2.0, 1.0)),
        ({"log_uniform": (0.1, 10.0)}, stats.loguniform(0.1, 10.0)),
        ({"normal": (1.0, 0.5), "within": (0.0, 3.0)}, stats.truncnorm(-2.0, 4.0, 1.0, 0.5)),
        ({"integers": (2, 5)}, stats.randint(2, 6)),
    ],
)
def test_distributions_are_scipys(values: dict[str, Any], reference: Any) -> None:
    distribution = Distribution(**values)
    u = np.linspace(0.001, 0.999, 334)
    np.testing.assert_allclose([distribution.value(x) for x in u], reference.ppf(u), rtol=1e-9)


@pytest.mark.parametrize("dimensions", [2, 3])
def test_a_ball_is_filled_evenly(dimensions: int) -> None:
    points = stats.qmc.Sobol(dimensions, seed=1).random(4096)
    drawn = np.array([Distribution(ball=2.0).point(u) for u in points])
    radius = np.linalg.norm(drawn, axis=1)
    assert radius.max() <= 2.0
    assert stats.kstest((radius / 2.0) ** dimensions, "uniform").statistic < 0.01
    np.testing.assert_allclose(drawn.mean(axis=0), 0.0, atol=0.01)
    np.testing.assert_allclose(np.cov(drawn.T), np.eye(dimensions) * 4.0 / (dimensions + 2), atol=0.02)


def test_the_replay_command_sets_every_value_to_the_last_digit(tmp_path: Path) -> None:
    import shlex

    spec = spec_of(tmp_path, SPEC)
    for sample in itertools.islice(Sampler(spec), 20):
        words = shlex.split(replay(spec, sample.overrides))
        assert words[:3] == ["fingergait", "run", "lift-and-rotate"]
        overrides = dict(parse_override(word) for flag, word in itertools.pairwise(words) if flag == "--set")
        overrides["seed"] = int(words[words.index("--seed") + 1])
        assert Scenario.load("lift-and-rotate", overrides) == spec.base().replace(sample.overrides)


def test_toml_values_come_back() -> None:
    values = {"a": [1, 2.5e-17, True], "b": {"text": 'say "no"', "n": -3}}
    assert parse_override(f"key={toml(values)}") == ("key", values)


@pytest.mark.parametrize("name", sorted(path.stem for path in (MODELS / "campaigns").glob("*.toml")))
def test_every_packaged_campaign_gives_scenarios(name: str) -> None:
    spec = CampaignSpec.load(name, 100)
    assert spec.description and spec.name == name
    assert len(list(Sampler(spec))) == 100


def _with(line: str) -> str:
    return f'scenario = "hold"\n{line}\n'


BAD: dict[str, tuple[str, str]] = {
    "not TOML": ("scenario =", r"case\.toml: expected TOML"),
    "no scenario": ("samples = 3", r"case\.toml: scenario: expected a value, found none"),
    "unknown key": (_with("sample = 3"), r"case\.toml: sample: expected no such key"),
    "nothing varied": (_with(""), r"case\.toml: vary: expected at least one key or \[\[fault\]\], found none"),
    "unknown method": (
        _with('method = "guess"\nvary.duration.uniform = [1.0, 2.0]'),
        r"method: expected 'sobol', .*'guess'",
    ),
    "two distributions": (
        _with("[vary]\nduration = { uniform = [1.0, 2.0], integers = [1, 2] }"),
        r"vary\.duration: expected exactly one of uniform, .*, found uniform and integers",
    ),
    "range upside down": (
        _with("[vary]\nduration = { uniform = [2.0, 1.0] }"),
        r"vary\.duration: expected uniform = \[low, high\] with low < high, found \[2\.0, 1\.0\]",
    ),
    "not finite": (
        _with("[vary]\nduration = { uniform = [1.0, inf] }"),
        r"vary\.duration\.uniform\.1: expected a finite",
    ),
    "unknown scenario key": (_with('[vary]\n"truth.mas" = { uniform = [1.0, 2.0] }'), r"truth\.mas: expected one of"),
    "element too far": (
        _with('[vary]\n"truth.com_offset[3]" = { uniform = [0.0, 1.0] }'),
        r"vary\.truth\.com_offset\[3\]: expected an element 0 to 2, found 3",
    ),
    "value out of range": (
        _with('[vary]\n"truth.friction" = { uniform = [-2.0, -1.0] }'),
        r"truth\.friction: expected gr",
    ),
    "ball of one": (_with('[vary]\n"truth.friction" = { ball = 0.1 }'), r"truth\.friction: expected two or three elem"),
    "unknown fault": (_with('[[fault]]\nkind = "gremlin"'), r"fault\.0\.kind: expected one of .* found 'gremlin'"),
    "fault key": (
        _with('[[fault]]\nkind = "pose_stale"\nfinger = 1'),
        r"fault\.0\.finger: expected one of label, promise",
    ),
    "grid with faults": (_with('method = "grid"\n[[fault]]\nkind = "pose_stale"\nat = 1.0'), r"method: expected sobol"),
    "promise": (
        _with('[[fault]]\nkind = "pose_stale"\nat = 1.0\npromise = "maybe"'),
        r"fault\.0\.promise: expected 'hold'",
    ),
}


@pytest.mark.parametrize("name", BAD)
def test_a_bad_spec_is_one_line_that_names_the_field(tmp_path: Path, name: str) -> None:
    text, message = BAD[name]
    with pytest.raises(ConfigError, match=message) as error:
        list(Sampler(spec_of(tmp_path, text)))
    assert "\n" not in str(error.value)
