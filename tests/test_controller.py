"""The controller's runtime against python-control, and artefacts that cannot be used."""

import json
from typing import Any

import control
import numpy as np
import pytest

import fingergait as fg
from fingergait.paths import find

AXES = 6


def artefact(name: str) -> dict[str, Any]:
    return dict(json.loads(find(name, "controllers", ".json", "controller").read_text()))


@pytest.mark.parametrize("name", ["pid", "mu"])
def test_runtime_agrees_with_python_control(name: str) -> None:
    data = artefact(name)
    e = np.random.default_rng(1).normal(size=(400, AXES)) * 1e-3
    u = fg.Controller(json.dumps(data)).simulate(e)
    for axis, K in enumerate(data["K"]["axes"]):
        system = control.ss(K["A"], K["B"], K["C"], K["D"], data["sample_time"])
        expected = control.forced_response(system, inputs=e[:, axis]).outputs
        np.testing.assert_allclose(u[:, axis], expected, rtol=1e-9, atol=1e-9 * np.abs(expected).max())


def test_full_controller_equals_its_axes() -> None:
    data = artefact("pid")
    axes = data["K"]["axes"]
    blocks = {key: np.zeros((0, 0)) for key in "ABCD"}
    for K in axes:
        for key in "ABCD":
            M, N = blocks[key], np.atleast_2d(np.asarray(K[key], dtype=float))
            joined = np.zeros((M.shape[0] + N.shape[0], M.shape[1] + N.shape[1]))
            joined[: M.shape[0], : M.shape[1]], joined[M.shape[0] :, M.shape[1] :] = M, N
            blocks[key] = joined
    full = {**data, "K": {"full": {key: M.tolist() for key, M in blocks.items()}}}
    e = np.random.default_rng(2).normal(size=(50, AXES))
    np.testing.assert_allclose(
        fg.Controller(json.dumps(full)).simulate(e), fg.Controller(json.dumps(data)).simulate(e), rtol=1e-12
    )


@pytest.mark.parametrize(
    ("change", "field"),
    [
        ({"format": "else/3"}, "format"),
        ({"kind": "guess"}, "kind"),
        ({"sample_time": -1.0}, "sample_time"),
        ({"nominal": {"mass": 0.0, "inertia": [1, 1, 1]}}, "nominal.mass"),
        ({"K": {"axes": []}}, "K.axes"),
        ({"surplus": 1}, "surplus"),
    ],
)
def test_bad_artefact_names_the_field(change: dict[str, Any], field: str) -> None:
    with pytest.raises(fg.ArtifactError, match=field):
        fg.Controller(json.dumps(artefact("pid") | change))


def test_wrong_rate_is_refused() -> None:
    hand = fg.HandModel(fg.hand_json(find("hand", "", ".xml", "hand")))
    with pytest.raises(fg.ArtifactError, match="sample_time"):
        fg.DualStagePlanner(hand, fg.Controller(json.dumps(artefact("pid"))), '{"rate_hz": 333}')
