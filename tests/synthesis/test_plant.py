"""Uncertainty, weights, reflected hand and the generalised plant against direct formulas."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from fingergait.synthesis import SpecError, SynthesisSpec, mu_bounds, reflect
from fingergait.synthesis.analysis import Problem, mu_curve, response
from fingergait.synthesis.pid import pid_controller
from fingergait.synthesis.plant import Actuation, AxisWeights, GeneralizedPlant
from fingergait.synthesis.statespace import append, lft_lower, system
from fingergait.synthesis.uncertainty import UncertainBody, damping_modes
from fingergait.synthesis.verify import coupled_axes, problems
from fingergait.synthesis.weights import Weight

from .hand_model import grasp
from .specs import CONTACT

OMEGA = np.geomspace(0.1, 2000.0, 15)


@settings(max_examples=50, deadline=None)
@given(
    st.floats(1.5, 1e4),
    st.floats(1e-4, 0.95),
    st.floats(0.1, 1e3),
    st.integers(1, 3),
    st.floats(0.1, 10.0),
    st.booleans(),
)
def test_weights_meet_their_figures(large, small, crossover, order, scale, falling):
    dc, high = (large, small) if falling else (small, large)
    weight = Weight(dc, high, crossover, order, scale).statespace()
    gains = np.abs(weight.at(np.array([0.0, crossover, 1e12]))[:, 0, 0])
    np.testing.assert_allclose(gains, [scale * dc, scale, scale * high], rtol=1e-3)
    assert weight.order == order and weight.is_stable()


def test_wrong_weights_name_the_field():
    for kwargs, name in (
        ({"dc_gain": -1.0, "high_gain": 1.0}, "dc_gain"),
        ({"dc_gain": 2.0, "high_gain": 1.0}, "crossover"),
        ({"dc_gain": 2.0, "high_gain": 3.0, "crossover": 1.0}, "above 1"),
        ({"dc_gain": 2.0, "high_gain": 0.5, "crossover": 1.0, "order": 0}, "order"),
    ):
        with pytest.raises(SpecError, match=name):
            Weight(**kwargs)


@settings(max_examples=25, deadline=None)
@given(st.lists(st.floats(-1.0, 1.0), min_size=12, max_size=12))
def test_lft_is_the_body_at_its_deltas(delta):
    """Closing Delta around the LFT gives the transfer of (E + P Delta) x'' + L (1 + R Delta) N x' = f."""
    body = SynthesisSpec.load(CONTACT).body()
    closed = lft_lower(flipped(body), system(np.zeros((0, 0)), np.zeros((0, 12)), np.zeros((12, 0)), np.diag(delta)))
    E, B = body.sample(np.array(delta[:6]), np.array(delta[6:]))
    w = 7.0
    expected = np.linalg.inv(-(w**2) * E + 1j * w * B)
    np.testing.assert_allclose(closed.at(w)[0], expected, rtol=1e-6, atol=1e-9 * np.abs(expected).max())


def flipped(body: UncertainBody):
    """The LFT with (z, w) last, so that the lower LFT closes Delta."""
    G, n = body.lft(), body.n_delta
    inputs = [*range(n, G.n_inputs), *range(n)]
    outputs = [*range(n, G.n_outputs), *range(n)]
    return G.select(outputs, inputs)


def test_damping_modes_make_up_the_damping_and_cover_a_common_factor():
    body = SynthesisSpec.load(CONTACT).body()
    B = np.array(SynthesisSpec.load(CONTACT).hand.damping)
    V = damping_modes(B)
    np.testing.assert_allclose(V @ V.T, B, atol=1e-9)
    _, scaled = body.sample(np.zeros(6), np.full(6, 0.6))
    np.testing.assert_allclose(scaled, (1 + 0.6 * body.damping_error) * body.damping, atol=1e-9)
    np.testing.assert_allclose(damping_modes(np.diag([4.0, 9.0])), np.diag([2.0, 3.0]))


def test_reflected_hand_with_contacts_below_the_centre():
    """Contacts 3.7 mm below Oo: 106, 71 N s/m, .0172, .0532 N m s, coupling .46 N s, .263, .095 kg."""
    G, J, M = grasp(0.0563, 0.060)
    hand = reflect(G, J, np.full(12, 0.05), M)
    np.testing.assert_allclose(np.diag(hand.damping), [106, 106, 71, 0.0172, 0.0172, 0.0532], rtol=0.02)
    assert hand.damping[0, 4] == pytest.approx(0.46, rel=0.05)
    assert hand.damping[1, 3] == pytest.approx(-0.46, rel=0.05)
    np.testing.assert_allclose(np.diag(hand.inertia), [0.263, 0.263, 0.095, 2.6e-5, 2.6e-5, 1.6e-4], rtol=0.08)


def test_shipped_spec_has_the_inertia_of_the_hand_at_the_first_grasp():
    """Contacts at the height of Oo, object on the palm: the grasp every shipped scenario starts from."""
    G, J, M = grasp(0.060, 0.060)
    hand = reflect(G, J, np.full(12, 0.05), M)
    stated = SynthesisSpec.load(CONTACT).hand.inertia
    np.testing.assert_allclose(np.diag(stated), np.diag(hand.inertia), rtol=0.04)


def test_the_kinematic_damping_changes_with_the_grasp_as_the_spec_says():
    for height, z, tilt in ((0.060, 82, 0.026), (0.071, 134, 0.042)):
        G, J, M = grasp(height, height)
        damping = np.diag(reflect(G, J, np.full(12, 0.05), M).damping)
        np.testing.assert_allclose(damping[[2, 3, 4]], [z, tilt, tilt], rtol=0.02)


def test_reflection_keeps_power_and_refuses_a_singular_hand():
    G, J, M = grasp(0.058, 0.060)
    damping = np.linspace(0.01, 0.1, 12)
    hand = reflect(G, J, damping, M)
    twist = np.array([0.1, -0.2, 0.05, 1.0, 0.3, -0.7])
    qd = np.linalg.solve(J, G.T @ twist)
    assert twist @ hand.damping @ twist == pytest.approx(qd @ (damping * qd))
    assert twist @ hand.inertia @ twist == pytest.approx(qd @ M @ qd)
    J[:, 0] = J[:, 1]
    with pytest.raises(ValueError, match="singular"):
        reflect(G, J, damping, M)


def test_generalized_plant_closes_to_the_formulas():
    """One axis, entry by entry: S, T and K S with weights, lag and Pade delay."""
    body = UncertainBody(np.array([[1.5]]), np.array([[60.0]]), np.eye(1), np.array([0.4]), 0.5)
    constant = Weight(1e-3, 1e-3), Weight(1e-4, 1e-4)
    weights = AxisWeights(Weight(100.0, 0.5, 6.0, 2), constant[0], Weight(80.0, 0.1, 600.0, 2), constant[1], 0.02)
    plant = GeneralizedPlant(body, [weights], Actuation(0.005, 0.003))
    K = pid_controller(20.0, 0.01, 0.002).system
    continuous = system([[-1.0]], [[1.0]], [[300.0]], [[900.0]])
    M = lft_lower(plant.statespace(), continuous).at(OMEGA)
    s = 1j * OMEGA
    act = (2 / 0.003 - s) / (2 / 0.003 + s) / (0.005 * s + 1)
    G = 1 / (1.5 * s**2 + 60.0 * s)
    k = continuous.at(OMEGA)[:, 0, 0]
    S = 1 / (1 + G * act * k)
    perf = weights.perf.statespace().at(OMEGA)[:, 0, 0]
    dis = weights.disturbance.statespace().at(OMEGA)[:, 0, 0]
    # inputs: w_M, w_B, r, d, n; outputs: z_M, z_B, w_perf, w_u
    np.testing.assert_allclose(M[:, 2, 2], perf * S * 0.02, rtol=1e-7)
    np.testing.assert_allclose(M[:, 2, 3], -perf * S * G * dis, rtol=1e-7)
    np.testing.assert_allclose(M[:, 2, 4], perf * (1 - S) * 1e-4, rtol=1e-7)
    np.testing.assert_allclose(M[:, 3, 2], 1e-3 * k * S * 0.02, rtol=1e-7)
    np.testing.assert_allclose(M[:, 0, 0], -0.4 * s**2 * G * S, rtol=1e-7)
    np.testing.assert_allclose(M[:, 1, 1], -0.5 * 60.0 * s * G * S, rtol=1e-7)
    exact = response(plant, continuous, OMEGA, 0.003)
    S = 1 / (1 + G * np.exp(-0.003 * s) / (0.005 * s + 1) * k)
    np.testing.assert_allclose(exact[:, 2, 2], perf * S * 0.02, rtol=1e-7)
    held = response(plant, K, OMEGA[OMEGA < 1500], 0.002)
    assert np.all(np.isfinite(held))


def test_uncoupled_parts_stand_for_the_whole():
    """mu of the whole six-axis matrix is that of its worst uncoupled part: shared mass, one performance block."""
    spec = SynthesisSpec.load(CONTACT)
    assert coupled_axes(spec) == [[0, 4], [1, 3], [2], [5]]
    axes = [pid_controller(40.0, 0.01, 0.002).system] * 6
    omega = np.geomspace(1.0, 300.0, 8)
    split = mu_curve(problems(spec, axes), omega, 0.002, lower=False, refine=0)
    whole = GeneralizedPlant(spec.body(), [spec.axis_weights(i) for i in range(6)], spec.actuation())
    M = response(whole, append(*axes), split.omega, 0.002)
    assert whole.blocks() == [(3, 0), (1, 1), (1, 1), (1, 1), *[(1, 1)] * 6, (18, 12)]
    upper, lower = mu_bounds(M[:8:2], whole.blocks())
    np.testing.assert_allclose(upper, split.upper[:8:2], rtol=2e-3)
    assert np.all(lower <= upper)


def test_without_coupling_the_full_problem_is_the_worst_axis():
    spec = SynthesisSpec.load(CONTACT)
    data = spec.model_dump()
    for name in ("inertia", "damping"):
        data["hand"][name] = np.diag(np.diag(data["hand"][name])).tolist()
    uncoupled = SynthesisSpec.parse(data)
    axes = [pid_controller(40.0, 0.01, 0.002).system] * 6
    omega = np.geomspace(1.0, 300.0, 12)
    full = mu_curve(problems(uncoupled, axes), omega, 0.002, lower=False, refine=0)
    single = [
        mu_curve([Problem(problems(uncoupled, axes)[i].plant, axes[i])], omega, 0.002, lower=False, refine=0).upper
        for i in range(6)
    ]
    np.testing.assert_allclose(full.upper, np.max(single, axis=0), rtol=1e-9)
