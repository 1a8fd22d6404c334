"""Funnel obligations against simulated barrier loops."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from stability import Interval
from stability.certificates.funnel import FunnelRow, funnel_margins


def row(**changed):
    given = {
        "beta": 40.0, "epsilon": 0.0, "delta": 1.0, "sigma": 1.0, "gain": Interval(0.9, 1.1), "disturbance": 0.5,
        "shoot": 0.2, "bound": 0.1, "rate": 2.0,
    }  # fmt: skip
    return FunnelRow(**{**given, **changed})


def value(margins, name):
    return next(m.value for m in margins if m.name == name)


def proved(margins):
    return all(m.verdict == "proved" for m in margins)


def test_scalar_closed_form():
    """One row, constant funnel, no adaptation: the margin is g_min β (1 - ρ) o / 2 - D."""
    margins = funnel_margins((row(shoot=0.1, rate=0.0),), 0.2)
    assert value(margins, "funnel 1") == pytest.approx(0.5 * 0.9 * 40.0 * 0.8 * 0.1 - 0.5, rel=1e-12)


def test_margin_is_where_the_loop_leaves():
    """x' = g u + w with w constant settles at D / (g β / 2): the obligation fails exactly where that reaches r."""
    edge = 0.5 * 0.9 * 40.0 * 0.8 * 0.1
    for disturbance in (0.99 * edge, 1.01 * edge):
        margins = funnel_margins((row(shoot=0.1, rate=0.0, disturbance=disturbance),), 0.2)
        rest = disturbance / (0.9 * 40.0 / 2)
        assert (value(margins, "funnel 1") > 0) == (rest < 0.08)


def simulate(rows, period, share, seed, seconds=4.0, substeps=8):
    """Largest |Q_i| / o_i of sampled barrier loops with clamp, each lane with its own signs; shape (n,)."""
    random, n, lanes = np.random.default_rng(seed), len(rows), 16
    pick = lambda kind: np.array([getattr(r, kind) for r in rows])[:, None]  # noqa: E731
    beta, epsilon, delta, sigma, limit = (pick(k) for k in ("beta", "epsilon", "delta", "sigma", "disturbance"))
    shoot, bound, rate = pick("shoot"), pick("bound"), pick("rate")
    gain = np.array([random.choice([r.gain.low, r.gain.high], lanes) for r in rows])
    x, theta, side = np.zeros((n, lanes)), np.zeros((n, lanes)), random.choice((-1.0, 1.0), (n, lanes))
    worst = np.zeros(n)
    hold = random.integers(5, 400, lanes)
    for k in range(round(seconds / period)):
        side = np.where(k % hold == 0, -side, side)
        o = (shoot - bound) * np.exp(-rate * k * period) + bound
        goal, q = np.zeros(lanes), np.zeros((n, lanes))
        for i in range(n):
            q[i] = x[i] - goal
            room = np.maximum(o[i] ** 2 - q[i] ** 2, share * o[i] ** 2 * 0.01)
            goal = -(beta[i] + epsilon[i] * theta[i] / room) * q[i] / 2
            theta[i] += period * (epsilon[i] * delta[i] * (q[i] / room) ** 2 / 2 - delta[i] * sigma[i] * theta[i])
        worst = np.maximum(worst, (np.abs(q) / o).max(axis=1))
        for _ in range(substeps):
            following = np.vstack([x[1:], goal[None]])
            x = x + period / substeps * (gain * following + limit * side)
    return worst


@settings(max_examples=15)
@given(st.integers(0, 10**6))
def test_what_is_proved_holds_in_simulation(seed):
    random = np.random.default_rng(seed)
    share, period = random.uniform(0.05, 0.5), 1e-4
    outer = row(
        beta=random.uniform(20, 60), shoot=0.2, rate=random.uniform(0, 3), disturbance=random.uniform(0, 1), epsilon=0.0
    )
    inner = row(
        beta=random.uniform(400, 3000), bound=random.uniform(0.5, 3), shoot=4.0, rate=1.0, epsilon=random.uniform(0, 0.5),
        disturbance=random.uniform(0, 30), gain=Interval(0.8, 1.2),
    )  # fmt: skip
    rows = (outer, inner)[: random.integers(1, 3)]
    if proved(funnel_margins(rows, share, period=period)):
        assert (simulate(rows, period, share, seed, seconds=1.5) <= 1 - share + 1e-9).all()


def test_two_rows_can_be_proved():
    outer = row(beta=40.0, disturbance=0.1, shoot=0.2, rate=1.0)
    inner = row(beta=2000.0, disturbance=10.0, bound=0.6, shoot=1.0, rate=1.0)
    margins = funnel_margins((outer, inner), 0.2, period=1e-4, limit=2000.0)
    assert [m.name for m in margins] == ["funnel 1", "funnel 2", "step 2", "saturation 2"]
    assert proved(margins)
    worst = simulate((outer, inner), 1e-4, 0.2, 1)
    assert (worst <= 0.8).all() and worst.max() > 0.01


@pytest.mark.parametrize(
    ("changed", "name"),
    [
        ({"disturbance": 2000.0}, "funnel 2"), ({"beta": 100.0}, "funnel 2"), ({"epsilon": 20.0}, "funnel 2"),
        ({"shoot": 50.0, "rate": 900.0}, "funnel 2"), ({"bound": 5.0, "shoot": 5.0}, "funnel 1"),
    ],
)  # fmt: skip
def test_what_costs_the_proof_is_named_with_what_would_do(changed, name):
    outer = row(beta=40.0, disturbance=0.1, shoot=0.2, rate=1.0)
    inner = {"beta": 2000.0, "disturbance": 10.0, "bound": 0.6, "shoot": 1.0, "rate": 1.0}
    margins = funnel_margins((outer, row(**{**inner, **changed})), 0.2, period=1e-4)
    failed = {m.name: m for m in margins if m.verdict != "proved"}
    assert name in failed and failed[name].remedy


def test_slow_sampling_and_small_inputs_are_refused():
    rows = (row(beta=40.0, disturbance=0.1, shoot=0.1, rate=0.0),)
    assert proved(funnel_margins(rows, 0.2, period=1e-3, limit=2.0))
    slow = funnel_margins(rows, 0.2, period=0.1)
    assert value(slow, "step 1") < 0 and value(slow, "funnel 1") < 0
    assert value(funnel_margins(rows, 0.2, limit=0.05), "saturation 1") < 0


@pytest.mark.parametrize(
    "changed", [{"beta": 0.0}, {"gain": Interval(0.0, 1.0)}, {"bound": 0.3}, {"rate": float("nan")}]
)
def test_rows_that_make_no_sense_are_refused(changed):
    with pytest.raises(ValueError, match="funnel row needs"):
        row(**changed)
    with pytest.raises(ValueError, match="between 0 and 1"):
        funnel_margins((row(),), 1.0)
