"""The observer obligation against exact peak gains."""

import numpy as np
import pytest
from scipy.linalg import expm

from stability.observer import observer_bounds


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
