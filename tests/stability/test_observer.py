"""The observer obligation against exact peak gains."""

import numpy as np
import pytest
from scipy.linalg import expm

from stability.networks.observer import SampledObserver, observer_bounds, sampled_bounds


def peak_gain(first, second, column, output, horizon=40.0):
    """L1 norm of the impulse response, by exact steps."""
    a = np.array([[-first, 1.0], [-second, 0.0]])
    step = horizon / first / 40_000
    advance, state, total = expm(a * step), np.array(column, dtype=float), 0.0
    for _ in range(40_000):
        following = advance @ state
        total += step * (abs(state[output]) + abs(following[output])) / 2
        state = following
    return total


@pytest.mark.parametrize("frequency", [50.0, 300.0])
def test_bounds_are_above_the_exact_peaks_and_near_them(frequency):
    first, second = 2.0 * frequency, frequency**2
    found = observer_bounds(first, second, noise=1e-6, disturbance=0.5)
    noise, push = (first, second), (0.0, 1.0)
    assert peak_gain(first, second, noise, 1) < found.amplification < 1.8 * peak_gain(first, second, noise, 1)
    assert peak_gain(first, second, push, 1) < found.sensitivity < 1.6 * peak_gain(first, second, push, 1)
    speed = 1e-6 * peak_gain(first, second, noise, 1) + 0.5 * peak_gain(first, second, push, 1)
    position = 1e-6 * peak_gain(first, second, noise, 0) + 0.5 * peak_gain(first, second, push, 0)
    assert speed < found.speed < 1.9 * speed and position < found.position < 1.9 * position


def test_faster_observers_trade_disturbance_for_noise():
    slow = observer_bounds(100.0, 2500.0, noise=1e-6, disturbance=0.5)
    fast = observer_bounds(400.0, 40_000.0, noise=1e-6, disturbance=0.5)
    assert fast.sensitivity < slow.sensitivity and fast.amplification > 3 * slow.amplification


def test_an_uncertain_encoder_costs_and_too_much_of_it_is_refused():
    known = observer_bounds(100.0, 2500.0, noise=1e-6, disturbance=0.5)
    uncertain = observer_bounds(100.0, 2500.0, noise=1e-6, disturbance=0.5, spread=0.1)
    assert known.speed < uncertain.speed
    assert observer_bounds(20.0, 10_000.0, noise=1e-6, disturbance=0.5, spread=0.95) is None


def test_gains_that_make_no_sense_are_refused():
    for gains in ((0.0, 1.0), (1.0, -1.0), (float("nan"), 1.0)):
        with pytest.raises(ValueError, match="positive gains"):
            observer_bounds(*gains, noise=1e-6, disturbance=0.5)


def worst_sampled(observer, noise, acceleration, samples=1500):
    """Exact worst case of a sampled observer with constant gain: L1 norms of its impulse responses."""
    t = observer.period
    a = np.array([[1 - observer.first, t], [-observer.second, 1.0]])
    # |x'' - a| <= A moves (x, x') by at most A times the integral of |e_i' exp(..)|, here by its extremes over a period
    columns = [(noise * np.array([observer.first, observer.second]), 1)]
    steps = 20
    fine = t / steps
    columns += [(acceleration * fine * np.array([t - (k + 0.5) * fine, 1.0]), 1) for k in range(steps)]
    total = np.zeros(2)
    for column, _ in columns:
        state = np.array(column, dtype=float)
        for _ in range(samples):
            total += np.abs(state)
            state = a @ state
    return total


@pytest.mark.parametrize(
    ("bandwidth", "period", "noise", "factor"),
    [(6000.0, 1 / 16000, 5e-9, 2.0), (300.0, 1e-3, 1e-7, 1.6), (6000.0, 1 / 16000, 1e-7, 4.0)],
)
def test_sampled_bounds_are_above_the_exact_worst_case_and_near_it(bandwidth, period, noise, factor):
    """Near it where the acceleration dominates; noise alone enters both rows, and costs several times its worst."""
    observer = SampledObserver.of_bandwidth(bandwidth, 0.0, period)
    found = sampled_bounds(observer, noise=noise, acceleration=1.0, initial=0.0)
    exact = worst_sampled(observer, noise, 1.0)
    assert exact[0] < found.position < factor * exact[0]
    assert exact[1] < found.speed < factor * exact[1]


@pytest.mark.parametrize("seed", range(3))
def test_sampled_bounds_hold_while_the_adaptive_gain_moves(seed):
    random, t = np.random.default_rng(seed), 1 / 16000
    observer = SampledObserver.of_bandwidth(6000.0, 0.15, t)
    found = sampled_bounds(observer, noise=5e-9, acceleration=1.0, initial=1e-4)
    error, a, noise = np.array([5e-9, 1e-4]), 1.0, 5e-9
    for _ in range(4000):
        assert abs(error[0]) <= found.position and abs(error[1]) <= found.speed
        a, noise = (v if random.random() < 0.9 else -v for v in (a, noise))
        gain = 1 + random.choice((0.0, random.random(), 1.0)) * observer.largest
        inward = gain * np.array([observer.first, observer.second]) * (error[0] + noise)
        error = np.array([[1, t], [0, 1]]) @ error - inward + a * np.array([t * t / 2, t])


def test_an_observer_that_does_not_contract_is_refused():
    assert sampled_bounds(SampledObserver(first=0.5, second=900.0, largest=8.0, period=1e-3), noise=1e-6,
                          acceleration=1.0, initial=0.0) is None  # fmt: skip
    with pytest.raises(ValueError, match="positive gains and period"):
        SampledObserver(first=0.0, second=1.0, largest=0.1, period=1e-3)
