"""The observer in the loop: its poles, its differences, and the loop with it against its exact worst case."""

from itertools import pairwise

import numpy as np
import pytest
from known_answers import DISTURBANCE, certify_impulse_chain, claim_of, verdict
from test_random_loops import model_of, watched_case

from stability import Observer, certify_impulse

ROUND = 1e-8


def own_dynamics(observer: Observer, period: float) -> np.ndarray:
    """(ξ, η) after a period without a measurement."""
    seen = np.array([[1 - observer.first, 0.0], [-observer.second, 1.0]])
    return np.array([[1.0, period], [0.0, 1.0]]) @ seen


@pytest.mark.parametrize(("bandwidth", "period"), [(10.0, 1e-3), (500.0, 1e-3), (6000.0, 62.5e-6), (3.0, 0.1)])
def test_a_bandwidth_is_a_double_pole(bandwidth, period):
    poles = np.linalg.eigvals(own_dynamics(Observer.of_bandwidth(bandwidth, period), period))
    assert poles == pytest.approx(np.full(2, np.exp(-bandwidth * period)), abs=np.sqrt(ROUND))


def test_without_a_bandwidth_speed_is_the_difference_of_two_measurements():
    observer, measured, before = Observer.of_bandwidth(None, 2e-3), [1.0, 1.5, 1.2, 1.9], np.array([1.0, 0.0])
    for last, now in pairwise(measured):
        missed = now - before[0]
        position, speed = before[0] + observer.first * missed, before[1] + observer.second * missed
        assert position == pytest.approx(now) and speed == pytest.approx((now - last) / 2e-3)
        before = np.array([position + 2e-3 * speed, speed])


@pytest.mark.parametrize("first", [0.0, -0.1, 1.5, float("nan")])
def test_gains_of_no_observer_are_refused(first):
    with pytest.raises(ValueError, match="an observer needs"):
        Observer(first=first, second=1.0)


@pytest.mark.parametrize("bandwidth", [None, 3000.0, 600.0])
def test_without_noise_a_load_costs_what_it_costs_at_rest(bandwidth):
    """The response to a load keeps its sign, so that its worst course is a constant one: D / (ω_1 ω_2) at rest."""
    observer = Observer.of_bandwidth(bandwidth, 1e-3)
    found = certify_impulse_chain((10.0, 60.0), period=1e-3, spread=0.0, observer=observer)
    assert 1.0 <= found.ultimate[0] / (DISTURBANCE / (10.0 * 60.0)) < 1.01


@pytest.mark.parametrize("seed", [1, 13, 19])
def test_the_checker_refuses_a_loop_with_another_observer(seed):
    case = watched_case(seed)
    model = model_of(case)
    found = certify_impulse(model, case.bounds, case.gains, case.limit)
    claim = claim_of(model, case.bounds, case.gains, found, limit=1e30, accuracy=1e30)
    assert verdict(claim)
    first, second = claim.observer
    shown = claim.shown
    changes = (
        {"observer": (first, second * 2)}, {"observer": (first / 2, second / 2)},
        *({"shown": [*shown[:k], shown[k] * 99 / 100, *shown[k + 1 :]]} for k in (0, 1)),
        {"noise": [claim.noise[0] * 2, *claim.noise[1:]]},
    )  # fmt: skip
    for change in changes:
        assert not verdict(type(claim)(**{**claim.__dict__, **change})), change
