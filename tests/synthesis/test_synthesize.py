"""The shipped synthesis from end to end: the certificate, the artefact, the report and the command."""

import json
import re
from pathlib import Path

import numpy as np
import pytest

from fingergait.synthesis import SynthesisError, SynthesisSpec, hand_tuned, synthesize
from fingergait.synthesis.command import run_synthesize
from fingergait.synthesis.design import STAGES, axis_groups, design_axes
from fingergait.synthesis.report import compare, render
from fingergait.synthesis.verify import campaign, nominal_loop

from .specs import CONTACT, SCALED, SPECS

SHIPPED = SPECS.parent / "controllers"


@pytest.fixture(scope="module")
def shipped():
    """The shipped spec, with few bodies: the full number is in test_two_thousand_bodies."""
    return synthesize(CONTACT, bodies=64)


def test_mu_is_below_one_on_every_axis_at_every_stage(shipped):
    for design in shipped.designs:
        assert set(design.mu) == set(STAGES)
        assert all(curve.peak < 1.0 for curve in design.mu.values())
        assert all(np.all(curve.lower <= curve.upper) for curve in design.mu.values())


def test_mu_of_the_coupled_problem_is_below_one_at_every_stage(shipped):
    assert all(curve.peak < 1.0 for curve in shipped.certificate.full.values())
    assert shipped.certificate.mu_peak <= shipped.certificate.complex_peak
    assert shipped.certificate.holds()


def test_the_bound_is_tight(shipped):
    curve = shipped.certificate.full[STAGES[-1]]
    assert curve.lower.max() > 0.95 * curve.peak


def test_order_is_at_most_six(shipped):
    assert shipped.order <= 6


def test_stability_is_certified_over_the_wide_damping_range(shipped):
    assert shipped.spec.uncertainty.damping.stable == [0.15, 2.0]
    assert shipped.certificate.stability is not None and shipped.certificate.stability.peak < 1.0


def test_sampled_loop_is_stable_at_random_corners_of_the_set(shipped):
    """An independent check of the certificate: eigenvalues of the exact sampled coupled loop."""
    spec = shipped.spec
    body = spec.body()
    loop = nominal_loop(spec, [K.system for K in shipped.axes])
    rng = np.random.default_rng(0)
    for _ in range(60):
        mass = rng.choice([-1.0, 1.0])
        inertia = np.concatenate([[mass] * 3, rng.choice([-1.0, 1.0], 3)])
        E, B = body.sample(inertia, rng.choice([-1.0, 1.0], 6))
        assert type(loop)(loop.K, E, B, loop.lag, loop.delay).is_stable()


def test_the_same_spec_gives_the_same_controller(shipped):
    again = design_axes(SynthesisSpec.load(CONTACT))
    for design, other in zip(shipped.designs, again, strict=True):
        for name in "ABCD":
            a, b = getattr(design.controller.system, name), getattr(other.controller.system, name)
            np.testing.assert_allclose(a, b, rtol=1e-9, atol=1e-9 * np.abs(a).max())


def test_equal_axes_share_a_design(shipped):
    assert axis_groups(shipped.spec) == [(0, 1), (2,), (3, 4), (5,)]
    assert shipped.axes[0] is shipped.axes[1] and shipped.axes[3] is shipped.axes[4]


def test_two_thousand_bodies(shipped):
    found = campaign(shipped.spec, shipped.axes, 2000, 1.5)
    assert found.bodies == 2000 and found.unstable == 0
    assert found.settling < 1.5


def test_the_measured_boundary_lies_outside_the_certified_one(shipped):
    found = shipped.certificate.boundary
    u = shipped.spec.uncertainty
    low, high = u.damping.centre * (1 - u.damping.size), u.damping.centre * (1 + u.damping.size)
    mass = (found.mass > 1 - u.mass) & (found.mass < 1 + u.mass)
    damping = (found.damping > low) & (found.damping < high)
    assert np.all(found.stable[np.ix_(damping, mass)])
    assert not np.all(found.stable)


def test_margins(shipped):
    margins = shipped.certificate.margins
    assert margins.delay > 0.01
    assert margins.gain_low < 0.5 and margins.gain_high > 2.0


def test_the_shipped_artefact_is_what_the_spec_gives(shipped):
    """models/controllers/mu.json is the product of models/specs/contact.toml."""
    stored = json.loads((SHIPPED / "mu.json").read_text())
    fresh = json.loads(json.dumps(shipped.artefact.as_dict()))
    assert stored["format"] == "fingergait-controller/1" and stored["kind"] == "mu-synthesis"
    for name in ("sample_time", "delay", "nominal", "prefilter", "description"):
        assert stored[name] == fresh[name]
    # the response, not the matrices: another LAPACK may turn the states' signs
    for a, b in zip(stored["K"]["axes"], fresh["K"]["axes"], strict=True):
        z = np.exp(1j * np.array([1e-3, 0.05, 0.5, 3.0]))
        np.testing.assert_allclose(transfer(a, z), transfer(b, z), rtol=1e-5)
    assert stored["provenance"]["figures"]["mu_peak"] == pytest.approx(shipped.certificate.mu_peak, abs=1e-4)


def transfer(K, z):
    A, B, C, D = (np.array(K[name]) for name in "ABCD")
    return np.array([(C @ np.linalg.solve(s * np.eye(len(A)) - A, B) + D).item() for s in z])


def test_the_pid_baseline_is_hand_tuned_and_shipped():
    stored = json.loads((SHIPPED / "pid.json").read_text())
    fresh = json.loads(json.dumps(hand_tuned(SynthesisSpec.load(CONTACT)).as_dict()))
    assert stored == fresh and stored["kind"] == "hand-tuned"
    # kp = 1.5 w^2, ki = .25 w^3 at low frequency
    z = np.exp(1j * 0.01 * 0.002)
    K = transfer(stored["K"]["axes"][0], np.array([z]))[0]
    assert K.real == pytest.approx(1.5 * 40**2, rel=1e-3)
    assert K.imag == pytest.approx(-0.25 * 40**3 / 0.01, rel=1e-3)


def test_the_artefact_explains_itself(shipped):
    provenance = shipped.artefact.as_dict()["provenance"]
    assert {"certificate", "figures", "blocks", "iterations", "spec", "versions"} <= set(provenance)
    assert tuple(provenance["blocks"][0]) == (3, 0) and tuple(provenance["blocks"][-1]) == (18, 12)
    text = " ".join(provenance["certificate"])
    assert "40 % error of the mass" in text and "500 Hz" in text and "2 ms" in text


def test_the_report_is_one_self_contained_page(shipped):
    page = render(shipped)
    assert page.count("<svg") == 7
    assert not re.search(r'(src|href)="https?:', page)
    for words in ("Departures from Table I", "The certificate in words", "W_perf.omega_c", "delay margin", "PID"):
        assert words in page
    for d in shipped.certificate.deviations:
        assert d.name in page
    assert render(shipped) == page


def test_the_comparison_shows_what_mu_gains_over_the_pid(shipped):
    rows = compare(shipped)
    assert len(rows) == 2 * len(shipped.designs)
    assert all(row.mu < 1.0 for row in rows if row.controller == "mu")
    assert any(row.mu > 1.0 for row in rows if row.controller == "PID")


def test_the_command_writes_both_files_and_clean_json(tmp_path, capsys):
    out = tmp_path / "scaled.json"
    run_synthesize(SCALED, out, True, bodies=40)
    printed = capsys.readouterr()
    figures = json.loads(printed.out)
    assert {
        "mu_peak", "mu_peak_per_axis", "order", "iterations", "seconds", "uncertainty", "rate_hz", "delay_s",
        "delay_margin_s", "gain_margins", "deviations", "artefact",
    } <= set(figures)  # fmt: skip
    assert figures["mu_peak"] < 1.0 and len(figures["mu_peak_per_axis"]) == 6
    assert "gamma" in printed.err and "mu peak" in printed.err
    assert Path(figures["artefact"]) == out and out.exists() and out.with_suffix(".html").exists()
    # an earlier study: .43, .53, .53, .61 without any dead time, here with half a sample
    peaks = [float(line.split()[-2]) for line in printed.err.splitlines() if line.startswith(("x y", "rz"))]
    assert min(peaks) == pytest.approx(0.44, abs=0.03)


def test_a_reduction_that_goes_too_far_is_refused():
    data = SynthesisSpec.load(CONTACT).model_dump()
    data["control"]["order"] = 2
    with pytest.raises(SynthesisError, match="order"):
        design_axes(SynthesisSpec.parse(data))
