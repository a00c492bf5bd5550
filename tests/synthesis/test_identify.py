"""The damping identified from a run, against a body integrated with a known one and against the shipped spec."""

from types import SimpleNamespace

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.spatial.transform import Rotation

import fingergait as fg
from fingergait.synthesis import SynthesisSpec, identify_damping

from .specs import CONTACT

LAG, DT = 0.005, 0.002


def test_identification_finds_the_damping_of_an_integrated_body():
    """A PD-held rigid body with a full, symmetric B, under pulses in all six directions."""
    spec = SynthesisSpec.load(CONTACT)
    scenario = fg.Scenario.load("push-at-rest")
    scales = [scenario.truth.mass_scale] * 3 + [scenario.truth.inertia_scale] * 3
    M = np.diag(scales) @ spec.nominal_inertia() + np.array(spec.hand.inertia)
    B = 1.3 * np.array(spec.hand.damping)
    stiffness = 20.0 * np.diag(np.diag(B))
    wrench = [np.concatenate([p.force, p.torque]) for p in scenario.disturbance]

    steps = round(scenario.duration / DT)
    state, commands, states = np.zeros(18), np.zeros((steps, 6)), np.zeros((steps, 12))
    for k in range(steps):
        t = k * DT
        command = -stiffness @ state[:6]
        push = sum((w for w, p in zip(wrench, scenario.disturbance, strict=True) if p.at <= t < p.at + p.duration), 0.0)
        commands[k], states[k] = command, state[:12]

        def rates(_, s, u=command, push=push):
            return np.concatenate([s[6:12], np.linalg.solve(M, s[12:] + push - B @ s[6:12]), (u - s[12:]) / LAG])

        state = solve_ivp(rates, (0.0, DT), state, method="RK45", rtol=1e-6, atol=1e-12).y[:, -1]

    pose = np.hstack([states[:, :3], np.roll(Rotation.from_rotvec(states[:, 3:6]).as_quat(), 1, axis=1)])
    rest = np.tile([0.0, 0, 0, 1, 0, 0, 0], (steps, 1))
    log = SimpleNamespace(
        t=np.arange(steps) * DT, pose={"object": pose, "desired": rest}.get, block={"F_des": commands}.get
    )
    found = identify_damping(log, scenario, spec)
    scale = np.sqrt(np.diag(B))
    np.testing.assert_allclose(found / np.outer(scale, scale), B / np.outer(scale, scale), atol=0.03)


def test_shipped_spec_has_the_damping_identified_in_contact():
    """With the shipped controller in MuJoCo; the model is linear and the contacts are not, hence the tolerance."""
    spec = SynthesisSpec.load(CONTACT)
    scenario = fg.Scenario.load("push-at-rest")
    found = identify_damping(fg.simulate(scenario).log, scenario, spec)
    stated = np.array(spec.hand.damping)
    scale = np.sqrt(np.diag(stated))
    np.testing.assert_allclose(found / np.outer(scale, scale), stated / np.outer(scale, scale), atol=0.12)


def test_identification_needs_pulses():
    scenario = fg.Scenario.load("hold")
    with pytest.raises(ValueError, match="disturbance"):
        identify_damping(None, scenario, SynthesisSpec.load(CONTACT))
