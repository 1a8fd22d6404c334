"""TLBO, random search, budgets, gradients, Pareto sets, decimals, workers."""

import math
import os
import signal
import threading
import time

import numpy as np
import pytest

from tuning import METHODS, Best, Budget, Derivatives, Outcome, best_of, descend, executor, front, search, start
from tuning.decimals import rounded, shortest
from tuning.methods.pareto import crowded_order, pareto_jaya
from tuning.methods.tlbo import tlbo


def sphere(points):
    return [Outcome(violation=0.0, cost=float(((p - 0.3) ** 2).sum()), runs=2) for p in points]


def half(points):
    """Feasible in a half of the cube."""
    return [
        Outcome(violation=0.0, cost=float(p.sum()), runs=1) if p[0] > 0.5 else Outcome(violation=0.5 - p[0] + 1e-9, cost=math.inf)
        for p in points
    ]  # fmt: skip


def test_one_step_of_tlbo_is_the_published_one():
    state = start(sphere, np.array([0.9, 0.9]), 6, seed=4)
    after = tlbo(sphere, state)
    random = state.generator()
    x, cost = state.points.copy(), np.array([o.cost for o in state.outcomes])

    def keep(trial):
        trial = np.clip(trial, 0, 1)
        new = ((trial - 0.3) ** 2).sum(axis=1)
        better = new < cost
        x[better], cost[better] = trial[better], new[better]

    factor = random.integers(1, 3)
    keep(x + random.uniform(size=2) * (x[cost.argmin()] - factor * x.mean(axis=0)))
    other = (np.arange(6) + random.integers(1, 6, 6)) % 6
    assert (other != np.arange(6)).all()
    r = random.uniform(size=x.shape)
    towards = np.where((cost < cost[other])[:, None], x - x[other], x[other] - x)
    keep(x + r * towards)
    assert after.points == pytest.approx(x) and after.evaluations == 6 + 12 and after.runs == 2 * 18


@pytest.mark.parametrize("method", METHODS)
def test_a_search_keeps_to_its_budget_counts_honestly_and_goes_on_where_it_stopped(method):
    counted = []

    def counting(points):
        counted.append(len(points))
        return sphere(points)

    states = []
    first = np.full(3, 0.9)
    whole = search(method, counting, first, 10, 3, Budget(evaluations=100), after=states.append)
    assert sum(counted) == whole.evaluations <= 100 and whole.evaluations > 100 - 20
    assert whole.runs == 2 * whole.evaluations
    resumed = search(method, sphere, first, 10, 3, Budget(evaluations=100), restored=states[len(states) // 2])
    assert (resumed.points == whole.points).all() and resumed.evaluations == whole.evaluations
    brief = search(method, sphere, first, 10, 3, Budget(evaluations=10**9, seconds=0.05))
    assert brief.evaluations < 10**8
    with pytest.raises(ValueError, match="jaya, tlbo, random"):
        search("genius", sphere, first, 10, 3, Budget(evaluations=20))


@pytest.mark.parametrize("method", ["jaya", "tlbo"])
def test_methods_beat_random_search_on_a_bowl(method):
    def median(name):
        runs = [search(name, sphere, np.full(4, 0.9), 20, seed, Budget(evaluations=800)) for seed in range(11)]
        return np.median([best_of(state).outcome.cost for state in runs])

    assert median(method) < 0.1 * median("random")


def test_an_infeasible_best_cannot_be_held():
    none = search("random", lambda points: [Outcome(violation=1.0, cost=math.inf) for _ in points], np.full(2, 0.5), 4, 1,
                  Budget(evaluations=12))  # fmt: skip
    assert best_of(none) is None and none.runs == 0
    with pytest.raises(ValueError, match="must be feasible"):
        Best(point=np.zeros(2), outcome=Outcome(violation=0.1, cost=math.inf))
    some = best_of(search("jaya", half, np.full(2, 0.1), 10, 1, Budget(evaluations=400)))
    assert some.outcome.feasible and some.point[0] == pytest.approx(0.5, abs=0.02) and some.point[1] < 0.05


def rosenbrock(point, wanted):
    """On the cube [0, 1]^2 stretched to [0, 1.5]^2, outside a disc about the minimum, which thus lies on its edge."""
    x, y = 1.5 * point
    cost = (1 - x) ** 2 + 10 * (y - x * x) ** 2
    slope = 1.5 * np.array([-2 * (1 - x) - 40 * x * (y - x * x), 20 * (y - x * x)])
    room, away = (x - 1) ** 2 + (y - 1) ** 2 - 0.04, 1.5 * np.array([[2 * (x - 1), 2 * (y - 1)]])
    return Derivatives(
        cost=cost, gradient=slope, slacks=np.array([room]), jacobian=away, evaluations=3 if wanted else 1
    )


def test_descent_ends_at_the_constrained_minimum_and_counts():
    starts = [np.array([0.1, 0.5]), np.array([0.9, 0.9])]
    tried, used = descend(rosenbrock, starts, 1, Budget(evaluations=400))
    x, y = 1.5 * tried[0]
    angles = np.linspace(0, 2 * np.pi, 100_000)
    edge = [1 + 0.2 * np.cos(angles), 1 + 0.2 * np.sin(angles)]
    best = ((1 - edge[0]) ** 2 + 10 * (edge[1] - edge[0] ** 2) ** 2).min()
    assert (1 - x) ** 2 + 10 * (y - x * x) ** 2 == pytest.approx(best, rel=1e-3) and used <= 400
    few, spent = descend(rosenbrock, starts, 1, Budget(evaluations=5))
    assert spent <= 7 and len(few) >= 1
    assert descend(rosenbrock, starts, 1, Budget(evaluations=400, seconds=-1.0)) == ([], 0)


def test_descent_survives_points_without_a_certificate():
    def holes(point, wanted):
        found = rosenbrock(point, wanted)
        return found if point[1] > 0.3 else Derivatives(
            cost=math.nan, gradient=found.gradient * math.nan, slacks=found.slacks * math.nan,
            jacobian=found.jacobian * math.nan, evaluations=1,
        )  # fmt: skip

    tried, _ = descend(holes, [np.array([0.2, 0.1]), np.array([0.2, 0.6])], 1, Budget(evaluations=300))
    assert tried and all(point[1] > 0.3 for point in tried)


def two_goals(points):
    """Pareto set: the segment from (0.2, 0.2) to (0.8, 0.2)."""
    made = []
    for p in points:
        goals = (float((p[0] - 0.2) ** 2 + (p[1] - 0.2) ** 2), float((p[0] - 0.8) ** 2 + (p[1] - 0.2) ** 2))
        made.append(Outcome(violation=0.0, cost=sum(goals), objectives=goals))
    return made


def test_a_pareto_search_covers_the_known_set():
    state = start(two_goals, np.array([0.5, 0.9]), 30, seed=2)
    for _ in range(60):
        state = pareto_jaya(two_goals, state)
    best = front(state.outcomes)
    points = state.points[best]
    assert len(best) > 20 and points[:, 1] == pytest.approx(0.2, abs=0.03)
    assert points[:, 0].min() < 0.25 and points[:, 0].max() > 0.75
    goals = np.array([state.outcomes[i].objectives for i in best])
    assert (np.diff(goals[:, 0]) >= 0).all() and (np.diff(goals[:, 1]) <= 0).all()


def test_crowded_order_puts_fronts_before_loneliness_and_infeasible_last():
    def made(*goals):
        return Outcome(violation=0.0, cost=1.0, objectives=goals)

    some = [made(5, 5), made(0, 2), made(1, 1), made(2, 0), Outcome(violation=0.1, cost=math.inf)]
    assert set(crowded_order(some)[:3]) == {1, 2, 3} and crowded_order(some)[3:] == [0, 4]
    assert front(some) == [1, 2, 3]


def test_short_decimals_are_taken_only_where_they_are_proved_and_cheap():
    assert rounded(24.351, 2, 8.0, 60.0) == 24.0 and rounded(59.96, 2, 8.0, 59.96) == 59.96

    def judged(outcomes):
        return lambda choices: outcomes[: len(choices)]

    now = Outcome(violation=0.0, cost=1.0)
    bad, dear, fine = (
        Outcome(violation=0.2, cost=math.inf), Outcome(violation=0.0, cost=1.1), Outcome(violation=0.0, cost=1.004)
    )  # fmt: skip
    assert shortest(["2", "3"], judged([bad, fine]), now) == ("3", fine)
    assert shortest(["2", "3"], judged([fine, fine]), now) == ("2", fine)
    assert shortest(["2", "3"], judged([bad, dear]), now) is None


def make_slow(pause):
    def slow(values):
        time.sleep(pause * len(values))
        return [(value * value, os.getpid()) for value in values]

    return slow


@pytest.mark.parametrize("cluster", [None, "local"])
def test_a_killed_worker_costs_time_but_no_result(cluster):
    """SIGKILL to the first worker that answered while the rest is under way."""
    items = list(range(40))
    with executor(make_slow, (0.02,), 2, cluster) as workers:
        victim = workers.map([0])[0][1]
        killer = threading.Timer(0.3, os.kill, (victim, signal.SIGKILL))
        killer.start()
        results = workers.map(items)
        killer.join()
        assert [value for value, _ in results] == [i * i for i in items]
        assert victim != os.getpid()


def test_results_come_with_their_index():
    with executor(make_slow, (0.001,), 2) as workers:
        assert {k: value for k, (value, _) in workers.completed([3, 1, 2])} == {0: 9, 1: 1, 2: 4}
        assert workers.map([]) == []


def test_batches_keep_hand_over_small_and_workers_busy():
    with executor(make_slow, (0.0,), 1) as here:
        assert here.batch_size(50) == 50
    with executor(make_slow, (0.0,), 2) as two:
        assert two.batch_size(50) == 13  # nothing measured yet: two batches a worker
        two._seconds_an_item = 1.0
        assert two.batch_size(50) == 13
        two._seconds_an_item = two.hand_over / (0.05 * 20)
        assert two.batch_size(50) == 20  # fewer hand-overs
        two._seconds_an_item = 1e-9
        assert two.batch_size(50) == 25  # every worker still has some
