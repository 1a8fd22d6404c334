import math

import numpy as np
import pytest

from tuning import Outcome, executor, start
from tuning.methods.jaya import jaya


def sphere(points):
    return [Outcome(violation=0.0, cost=float(((p - 0.3) ** 2).sum())) for p in points]


def disc(points):
    """Feasible only beyond 0.6 in the first coordinate."""
    made = []
    for p in points:
        excess = max(0.0, 0.6 - p[0])
        made.append(Outcome(violation=excess, cost=math.inf if excess else float((p**2).sum())))
    return made


def test_an_infeasible_candidate_has_no_cost():
    with pytest.raises(ValueError, match="no cost"):
        Outcome(violation=0.1, cost=1.0)


def test_feasible_comes_before_infeasible():
    good, worse = Outcome(violation=0.0, cost=9.0), Outcome(violation=0.0, cost=10.0)
    near, far = Outcome(violation=0.1, cost=math.inf), Outcome(violation=2.0, cost=math.inf)
    assert sorted([far, worse, near, good], key=Outcome.rank) == [good, worse, near, far]


def test_one_step_is_the_published_formula_with_greedy_acceptance():
    state = start(sphere, np.array([0.9, 0.9]), 6, seed=4)
    after = jaya(sphere, state)
    random = np.random.default_rng()
    random.bit_generator.state = state.random
    x = state.points
    costs = [o.cost for o in state.outcomes]
    best, worst = x[int(np.argmin(costs))], x[int(np.argmax(costs))]
    r1, r2 = random.uniform(size=x.shape), random.uniform(size=x.shape)
    trial = np.clip(x + r1 * (best - np.abs(x)) - r2 * (worst - np.abs(x)), 0, 1)
    for k in range(6):
        new, old = ((trial[k] - 0.3) ** 2).sum(), costs[k]
        assert after.points[k] == pytest.approx(trial[k] if new < old else x[k])
        assert after.outcomes[k].cost <= old
    assert after.evaluations == 12 and after.iteration == 1


def test_search_converges_and_repeats():
    def run(seed):
        state = start(sphere, np.full(3, 0.9), 12, seed)
        for _ in range(60):
            state = jaya(sphere, state)
        return state

    first, again = run(1), run(1)
    assert first.outcomes[first.best].cost < 1e-4
    assert (first.points == again.points).all()


def test_search_ends_inside_the_feasible_set_at_its_edge():
    state = start(disc, np.array([0.1, 0.8]), 12, seed=2)
    for _ in range(60):
        state = jaya(disc, state)
    best = state.points[state.best]
    assert state.outcomes[state.best].feasible and best[0] == pytest.approx(0.6, abs=0.02)


def make_square(shift):
    return lambda values: [value * value + shift for value in values]


def test_executors_agree():
    items = list(range(20))
    with executor(make_square, (3,), 1) as one, executor(make_square, (3,), 2) as two:
        assert one.map(items) == two.map(items) == [i * i + 3 for i in items]
