"""The nonlinear rigid body against SciPy and the linear sampled loop."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from fingergait.synthesis import SynthesisSpec
from fingergait.synthesis.loop import simulate
from fingergait.synthesis.pid import pid_controller
from fingergait.synthesis.rigid_body import exponential, rotation_vector, simulate_step
from fingergait.synthesis.verify import PAPER_STEP, bodies, nominal_loop, runtime, sample_deltas

from .specs import CONTACT

PID = [pid_controller(30.0, 0.01, 0.002)] * 6


def test_rotations_against_scipy():
    vectors = np.random.default_rng(0).normal(size=(50, 3))
    np.testing.assert_allclose(exponential(vectors), Rotation.from_rotvec(vectors).as_matrix(), atol=1e-12)
    np.testing.assert_allclose(rotation_vector(exponential(vectors)), vectors, atol=1e-9)
    small = 1e-10 * vectors
    np.testing.assert_allclose(rotation_vector(exponential(small)), small, atol=1e-16)


def test_small_steps_agree_with_the_linear_loop():
    """Nominal body, no mismatch, a step a thousand times smaller: the coupled linear loop, to 2 % of the step."""
    spec = SynthesisSpec.load(CONTACT)
    nominal = np.zeros((1, 5))
    centre, size = spec.uncertainty.damping.centre, spec.uncertainty.damping.size
    nominal[0, 4] = (1.0 / centre - 1.0) / size
    step = 1e-3 * PAPER_STEP
    outcome = simulate_step(bodies(spec, nominal), runtime(spec, PID), step, 0.4)
    system = nominal_loop(spec, [K.system for K in PID]).system()
    inputs = np.zeros((200, 18))
    inputs[:, :6] = step
    linear = simulate(system, inputs)[1:, :6]  # the output is taken before the step, the outcome after it
    found = (step - outcome.error[:-1, 0])[: len(linear)]
    np.testing.assert_allclose(found, linear, atol=0.02 * np.abs(step).max())
    moved = np.flatnonzero(step)
    np.testing.assert_allclose(found[:, moved] / step[moved], linear[:, moved] / step[moved], atol=0.02)


def test_gravity_of_a_wrong_mass_is_a_disturbance():
    """The PID's integral takes it away; at first the lighter body rises by about (m0 - m) g over the stiffness."""
    spec = SynthesisSpec.load(CONTACT)
    light = np.array([[-1.0, 0.0, 0.0, 0.0, 0.0]])
    outcome = simulate_step(bodies(spec, light), runtime(spec, PID), np.zeros(6), 2.5)
    z = -outcome.error[:, 0, 2]
    assert 3e-4 < z.max() < 3e-3
    assert abs(z[-1]) < 0.1 * z.max()
    assert np.abs(outcome.error[:, 0, [0, 1]]).max() < 1e-9


def test_limits_hold_and_anti_windup_recovers():
    """A hundred times the step saturates the wrench; with back-calculation the overshoot stays small."""
    spec = SynthesisSpec.load(CONTACT)
    big = np.array([0.4, 0.0, 0.0, 0.0, 0.0, 0.0])
    outcome = simulate_step(bodies(spec, np.zeros((1, 5))), runtime(spec, PID), big, 6.0)
    assert not outcome.unstable[0]
    speed = np.diff(outcome.error[:, 0, 0]) / 0.002
    terminal = spec.control.force_limit / (spec.uncertainty.damping.centre * spec.hand.damping[0][0])
    assert np.abs(speed).max() < 1.3 * terminal
    assert outcome.overshoot(big)[0, 0] < 0.15
    assert abs(outcome.error[-1, 0, 0]) < 0.02


def test_an_unstable_body_is_told_apart():
    """A controller with the sign turned round."""
    spec = SynthesisSpec.load(CONTACT)
    K = pid_controller(-30.0, 0.01, 0.002)
    outcome = simulate_step(bodies(spec, np.zeros((2, 5))), runtime(spec, [K] * 6), PAPER_STEP, 3.0)
    assert np.abs(outcome.error[-1]).max() > np.abs(PAPER_STEP).max()


def test_samples_hold_the_vertices_first():
    delta = sample_deltas(100)
    assert delta.shape == (100, 5) and np.abs(delta).max() == 1.0
    assert len(np.unique(delta[:32], axis=0)) == 32 and np.all(np.abs(delta[:32]) == 1.0)
    np.testing.assert_array_equal(delta, sample_deltas(100))


def test_settling_and_overshoot_of_a_known_response():
    spec = SynthesisSpec.load(CONTACT)
    outcome = simulate_step(bodies(spec, np.zeros((1, 5))), runtime(spec, PID), PAPER_STEP, 0.01)
    t = np.linspace(0.002, 2.0, 1000)
    error = np.zeros((1000, 1, 6))
    error[:, 0, 0] = 0.004 * np.exp(-5.0 * t)
    error[:, 0, 1] = 0.004 * np.exp(-2.0 * t) * np.cos(10.0 * t)
    known = type(outcome)(t, error, np.zeros(1, dtype=bool))
    settling = known.settling(PAPER_STEP)
    assert settling[0, 0] == pytest.approx(np.log(20.0) / 5.0, abs=0.003)
    assert np.isnan(settling[0, 3])
    assert known.overshoot(PAPER_STEP)[0, 0] == 0.0
    assert known.overshoot(PAPER_STEP)[0, 1] == pytest.approx(np.exp(-2.0 * np.pi / 10.0), rel=0.05)
