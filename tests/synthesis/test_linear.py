"""State-space algebra, reduction, discretisation and the sampled loop against independent computations."""

import control
import numpy as np
import pytest
from scipy import linalg

from fingergait.synthesis.discretise import anti_windup, discretise, tustin
from fingergait.synthesis.errors import SynthesisError
from fingergait.synthesis.loop import SampledLoop, delay_margin, gain_margins, hold, noise_deviation, simulate
from fingergait.synthesis.pid import pid
from fingergait.synthesis.reduction import balance, reduce
from fingergait.synthesis.statespace import (
    StateSpace,
    append,
    balanced_scaling,
    close_loop,
    first_order_chain,
    gain,
    lft_lower,
)

RNG = np.random.default_rng(1)
OMEGA = np.logspace(-1, 3, 25)


def random_system(n: int, m: int, p: int) -> StateSpace:
    A = RNG.normal(size=(n, n))
    A -= (1.0 + np.linalg.eigvals(A).real.max()) * np.eye(n)
    return StateSpace(A, RNG.normal(size=(n, m)), RNG.normal(size=(p, n)), RNG.normal(size=(p, m)))


def test_frequency_response_of_python_control():
    G = random_system(4, 2, 3)
    expected = np.moveaxis(control.ss(G.A, G.B, G.C, G.D)(1j * OMEGA), -1, 0)
    np.testing.assert_allclose(G.at(OMEGA), expected, rtol=1e-9)


def test_series_append_and_lft_act_on_responses_as_they_should():
    G, H, K = random_system(3, 2, 2), random_system(2, 2, 2), random_system(2, 1, 1)
    np.testing.assert_allclose((G @ H).at(OMEGA), G.at(OMEGA) @ H.at(OMEGA), rtol=1e-8)
    both = append(G, H).at(OMEGA)
    np.testing.assert_allclose(both[:, 2:, 2:], H.at(OMEGA), rtol=1e-9)
    assert np.abs(both[:, :2, 2:]).max() == 0.0
    P = random_system(4, 3, 3)
    np.testing.assert_allclose(lft_lower(P, K).at(OMEGA), close_loop(P.at(OMEGA), K.at(OMEGA)), rtol=1e-7)
    np.testing.assert_allclose(balanced_scaling(P).at(OMEGA), P.at(OMEGA), rtol=1e-8)
    assert append(gain(2.0), gain(3.0)).at(1.0)[0, 1, 1] == 3.0


def test_reduction_is_exact_for_what_is_not_there_and_keeps_dc():
    G = first_order_chain([5.0, 3.0, 40.0], [1.0, 10.0, 100.0], 2.0)
    doubled = append(G, G)
    redundant = StateSpace(doubled.A, doubled.B @ np.ones((2, 1)) / 2, np.ones((1, 2)) @ doubled.C, G.D)
    assert redundant.order == 6
    small = reduce(redundant, 3)
    np.testing.assert_allclose(small.at(OMEGA), redundant.at(OMEGA), rtol=1e-6)
    smaller = reduce(redundant, 2)
    np.testing.assert_allclose(smaller.at(1e-9), redundant.at(1e-9), rtol=1e-6)
    _, hankel = balance(G)
    error = np.abs(reduce(G, 2).at(OMEGA) - G.at(OMEGA)).max()
    assert error <= 2 * hankel[2:].sum() * (1 + 1e-9)


def test_reduction_of_an_unstable_controller_is_refused():
    with pytest.raises(SynthesisError, match="stable"):
        reduce(StateSpace(np.eye(2), np.ones((2, 1)), np.ones((1, 2)), np.zeros((1, 1))), 1)


def test_tustin_is_the_bilinear_transform():
    G, dt = random_system(4, 1, 1), 0.01
    z = np.exp(1j * OMEGA * dt)
    expected = control.ss(G.A, G.B, G.C, G.D)(2 / dt * (z - 1) / (z + 1))
    np.testing.assert_allclose(tustin(G, dt).at(OMEGA)[:, 0, 0], expected, rtol=1e-9)


def test_anti_windup_decays_as_asked_and_leaves_the_free_controller_alone():
    K = discretise(pid(40.0, 0.01), 0.002, windup_decay=15.0)
    rates = -np.log(np.abs(np.linalg.eigvals(K.system.A - K.L @ K.system.C))) / 0.002
    assert rates.min() >= 15.0
    with pytest.raises(SynthesisError, match="unstable"):
        discretise(StateSpace(np.eye(1), np.eye(1), np.eye(1), np.eye(1)), 0.002)
    assert anti_windup(gain(2.0, 0.002), 10.0).shape == (0, 1)


def test_sampled_loop_agrees_with_a_fine_continuous_simulation():
    """PID on a damped mass with lag and a delay of 1.7 samples, against Euler steps of 2 us."""
    K = tustin(pid(20.0, 0.01), 0.002)
    loop = SampledLoop(K, np.array([[1.3]]), np.array([[30.0]]), 0.005, 0.0034)
    inputs = np.zeros((150, 3))
    inputs[:, 0] = 1.0
    inputs[50:, 1] = 100.0
    found = simulate(loop.system(), inputs)

    h, x, v, a, state, commands = 2e-6, 0.0, 0.0, 0.0, np.zeros(2), []
    expected = []
    for k in range(150):
        e = inputs[k, 0] - x
        u = float(K.C[0] @ state + K.D[0, 0] * e)
        state = K.A @ state + K.B[:, 0] * e
        commands.append(u)
        expected.append(x)
        for i in range(1000):
            when = (k * 0.002 + (i + 0.5) * h - 0.0034) / 0.002
            applied = commands[int(when)] if when >= 0.0 else 0.0
            a += h * (applied - a) / 0.005
            v += h * (a + inputs[k, 1] - 30.0 * v) / 1.3
            x += h * v
    np.testing.assert_allclose(found[:, 0], expected, atol=2e-4)


def test_margins_agree_with_the_loop_gain():
    """Gain and delay margin from the frequency response of the sampled loop, hold and delay included."""
    K = tustin(pid(20.0, 0.01), 0.002)
    loop = SampledLoop(K, np.array([[1.0]]), np.array([[5.0]]), 0.005, 0.002)
    w = np.geomspace(0.5, 1500.0, 200_000)
    s = 1j * w
    L = K.at(w)[:, 0, 0] * hold(w, 0.002) * np.exp(-0.002 * s) / (0.005 * s + 1) / (s * (s + 5.0))
    crossing = np.flatnonzero(np.diff(np.sign(np.abs(L) - 1.0)))[-1]
    delay = (np.pi + np.angle(L[crossing])) / w[crossing]
    assert delay_margin(loop) == pytest.approx(delay, rel=0.01)
    real = np.flatnonzero((np.diff(np.sign(L.imag)) != 0) & (L.real[:-1] < 0) & (w[:-1] > w[crossing]))[0]
    assert gain_margins(loop)[1] == pytest.approx(-1.0 / L[real].real, rel=0.01)


def test_noise_deviation_against_a_long_simulation():
    loop = SampledLoop(tustin(pid(20.0, 0.01), 0.002), np.array([[1.0]]), np.array([[5.0]]), 0.005, 0.002, 25.0)
    system = loop.system()
    expected = noise_deviation(system, np.diag([0.0, 0.0, 1e-6]))
    inputs = np.zeros((60_000, 3))
    inputs[:, 2] = np.random.default_rng(0).normal(scale=1e-3, size=60_000)
    found = simulate(system, inputs)[2000:].std(axis=0)
    np.testing.assert_allclose(found, expected, rtol=0.1)


def test_append_and_lyapunov_oracle():
    """The doubling of noise_deviation against scipy on a system without a delay line."""
    G = tustin(random_system(4, 2, 2), 0.01)
    X = linalg.solve_discrete_lyapunov(G.A, G.B @ G.B.T)
    expected = np.sqrt(np.diag(G.C @ X @ G.C.T + G.D @ G.D.T))
    np.testing.assert_allclose(noise_deviation(G, np.eye(2)), expected, rtol=1e-8)
