"""Oracles of theory §3: closed forms and worst cases known independently of the prover."""

import math
from dataclasses import replace

import numpy as np
import pytest
from known_answers import (
    DISTURBANCE,
    ORACLE_ROWS,
    certify_chain,
    chain_bounds,
    integrator_chain,
)

from stability import Composition, Failure, Gains, Interval, certify
from stability.certificates.gain_condition import gain_condition
from stability.loops.model import Bounds


def bound(found):
    assert isinstance(found, Composition), found
    return 1e3 * float(found.ultimate[0])


def worst_case(w1, w2, gain=1.0):
    """L1 norm of the impulse response from w to x_1, in mm: the loop is x'' = -w1 (..) overdamped, so the DC gain."""
    return 1e3 * DISTURBANCE / (w1 * w2 * gain)


@pytest.mark.parametrize(("bandwidths", "row"), ORACLE_ROWS.items())
def test_oracle_table(bandwidths, row):
    exact, composition, adversary, spread = row
    assert worst_case(*bandwidths) == pytest.approx(exact, abs=1.1e-3)
    assert worst_case(*bandwidths, gain=0.8) == pytest.approx(adversary, rel=5e-3)  # a constant gain is not the worst
    found = bound(certify_chain(bandwidths))
    assert found == pytest.approx(composition, rel=4e-3)
    uncertain = bound(certify_chain(bandwidths, spread=0.2))
    assert uncertain == pytest.approx(spread, rel=6e-3)
    assert exact < found < uncertain and adversary < uncertain
    w1, w2 = bandwidths
    nu = 2 * (w2 - w1) - 2 * w1
    assert found < 1e3 * DISTURBANCE / (w1 * math.sqrt(nu * 2 * w1))


def test_decay_and_third_subsystem():
    found = certify_chain((15, 100))
    assert isinstance(found, Composition) and found.decay == pytest.approx(16.2, abs=0.3)
    assert bound(certify_chain((15, 100, 600))) == pytest.approx(0.621, rel=5e-3)


@pytest.mark.parametrize(("period", "fallback"), [(1e-3, 0.92), (2e-3, 1.45)])
def test_sampled_bound_is_sound_and_no_looser_than_the_published_fallback(period, fallback):
    found = bound(certify_chain((15, 100), period=period))
    assert worst_case(15, 100) < found <= fallback


def test_bandwidths_that_are_not_separated_are_refused():
    """With g = 1 two states need ω_2 > ω_1 + ν/2."""
    assert isinstance(certify_chain((100, 90)), Failure)
    assert isinstance(certify_chain((100, 110), disturbance=1e-3), Composition)


def first_order(kappa, period, disturbance=0.1):
    """x' = u + w, u = -κ x(t_k)."""
    model, base = integrator_chain(1), chain_bounds(1, period=period, disturbance=disturbance)
    return certify(model, base, (Gains(beta=2 * kappa),), np.array([1e6]))


@pytest.mark.parametrize("product", [0.05, 0.2, 0.35, 0.45])
def test_sampled_integrator_accepted_when_slow(product):
    found = first_order(10.0, product / 10.0)
    assert isinstance(found, Composition)
    assert gain_condition(found).holds


@pytest.mark.parametrize("product", [2.0, 2.5, 10.0])
def test_sampled_integrator_refused_from_the_stability_limit(product):
    assert isinstance(first_order(10.0, product / 10.0), Failure)


def test_scalar_closed_form():
    """x' = -ω x + w: the exact ultimate bound is D/ω; V gives D/√(νμ) with ν + μ = 2ω, the same at ν = μ."""
    found = certify(integrator_chain(1), chain_bounds(1), (Gains(beta=14.0),), np.array([10.0]))
    assert bound(found) == pytest.approx(1e3 * DISTURBANCE / 7.0, rel=0.02)


@pytest.mark.parametrize("unit", [1e-8, 1e-3, 1.0, 1e3, 1e8])
def test_bound_scales_with_the_unit(unit):
    """Lengths in other units: the same loop, the same bound."""
    found = certify_chain((15, 100), unit=unit, period=1e-3)
    assert bound(found) / unit == pytest.approx(bound(certify_chain((15, 100), period=1e-3)), rel=0.02)
    assert gain_condition(found).holds


def adaptive_bounds(period):
    base = chain_bounds(1, period=period)
    return Bounds(**{**base.__dict__, "noise": (1e-4,), "initial": (1e-3,)})


def test_theta_in_v_needs_delta_sigma_at_least_mu():
    """Where p > 0 the adaptation must decay as fast as V (condition ii)."""
    model, base = integrator_chain(1), adaptive_bounds(1e-4)
    slow = (Gains(beta=14.0, epsilon=30.0, delta=0.1, sigma=0.1),)
    fast = (Gains(beta=14.0, epsilon=30.0, delta=20.0, sigma=2.0),)
    for gains in (slow, fast):
        found = certify(model, base, gains, np.array([10.0]), adaptive=True)
        assert isinstance(found, Composition)
        assert gain_condition(found).holds
        if found.leak[0] > 0:
            assert gains[0].delta * gains[0].sigma >= found.decay


def test_the_exact_condition_refuses_what_is_moved():
    """More decay than its spare, no weight, a coupling that grows, θ̂ in V where the gain may vanish."""
    found = certify_chain((15, 100), spread=0.1)
    assert isinstance(found, Composition)
    told = gain_condition(found)
    assert told.holds and len(told.margins) == 2 and min(told.margins) >= told.spare > 0
    rows = found.rows
    worse = [
        replace(found, decay=found.decay + 1.01 * told.spare + found.decay / 1000),
        replace(found, weights=found.weights * [1.0, 0.0]),
        replace(found, rows=replace(rows, high=rows.high + np.abs(rows.high) * 0.5)),
        replace(found, leak=np.array([0.0, 1.0]), rows=replace(rows, control_gain=np.zeros(2))),
    ]
    assert not any(gain_condition(moved).holds for moved in worse)


def test_the_load_is_a_disturbance_of_known_size_only():
    """An adversary that uses the whole disturbance range is never outside the certified ball."""
    found = certify_chain((12, 80), period=1e-3, spread=0.1)
    limit = bound(found) / 1e3
    random = np.random.default_rng(5)
    for gain in (0.9, 1.1):
        for hold in (1, 20, 200):
            x, v, largest = 0.0, 0.0, 0.0
            for k in range(8000):
                if k % hold == 0:
                    w = DISTURBANCE * random.choice((-1.0, 1.0))
                u = -80.0 * (v + 12.0 * x)
                x, v = x + 1e-3 * v + 5e-7 * (gain * u + w), v + 1e-3 * (gain * u + w)
                largest = max(largest, abs(x))
            assert largest < limit


def test_an_interval_of_gains_that_holds_zero_is_refused():
    base = chain_bounds(2)
    lost = Bounds(**{**base.__dict__, "parameters": {"g": Interval(0.0, 1.0)}})
    assert isinstance(certify(integrator_chain(2), lost, (Gains(beta=30.0), Gains(beta=200.0)), np.ones(2)), Failure)
