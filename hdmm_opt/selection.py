"""The two stages of the gain selection: convex programs to a proved start, then a search over the proved set."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from stability import Composition, Gains, certify, error_rows
from tuning import Best, Budget, Outcome, Population, Selection, best_of, select
from tuning import search as run_search
from tuning.decimals import rounded, shortest

from .axis import KINDS, Axis
from .evaluation import evaluate, make_evaluator
from .problem import Problem
from .proof import certificate, violation
from .state import State
from .workers import workers

Array = NDArray[np.float64]

#: Where the first stage begins: positions of the outer gain in its range, and ratios of successive bandwidths.
OUTER_SHARES, SEPARATIONS = (0.1, 0.25, 0.4, 0.6), (5.0, 8.0, 12.0)
#: The first stage aims at this share of the required error, so that the proof keeps room.
AIM = 0.8
#: Significant digits that the winner's gains may shrink to, fewest first.
SHORT_DIGITS = (2, 3)


@dataclass(frozen=True, kw_only=True)
class Progress:
    """Where the pipeline reports to.

    Attributes:
        stage: Called with the name of a stage.
        update: Called with a share of the stage done, and a text such as the best so far.
    """

    stage: Callable[[str], None] = lambda name: None
    update: Callable[[float, str], None] = lambda share, text: None


@dataclass(frozen=True, kw_only=True)
class Options:
    """How to run.

    Attributes:
        seed: Seed of the search; that of the study where None.
        jobs: Processes for candidates, threads for runs.
        full: The large budget.
        state: File that keeps the state of the job; None keeps none.
        resume: Go on from that file.
        cluster: Address of a Dask scheduler for the candidates, or "local".
    """

    seed: int | None = None
    jobs: int = 1
    full: bool = False
    state: Path | None = None
    resume: bool = False
    cluster: str | None = None


@dataclass(frozen=True, kw_only=True)
class Found:
    """What a search ends with.

    Attributes:
        gains: The best gains that were met; proved and inside all limits where `best` says so.
        best: The outcome of proved gains, or None.
        evaluations: Candidates evaluated, infeasible ones included.
        runs: Closed-loop runs.
    """

    gains: tuple[Gains, ...]
    best: Best | None
    evaluations: int
    runs: int


def starting_point(problem: Problem) -> Selection:
    """Stage one: proved gains by convex programs, or the least bad that were met."""
    count = len(problem.law.governed)
    if not problem.searched:
        gains = problem.gains(np.zeros(0))
        return Selection(gains=gains, certificate=certificate(problem, gains), rounds=1)
    return select(
        lambda gains: certificate(problem, gains),
        lambda gains: certify(problem.model, replace(problem.bounds, period=0.0), gains, problem.box),
        lambda found: violation(problem, found, ()),
        bandwidth_ladder(problem),
        [(problem.ranges[4 * k].low, problem.ranges[4 * k].high) for k in range(count)],
        AIM * problem.study.requirements.tracking_error_m,
    )


def bandwidth_ladder(problem: Problem) -> list[tuple[Gains, ...]]:
    """Gains with separated bandwidths ω_i = g_i β_i / (2 M_i) inside the ranges, and the least adaptation."""
    quiet = problem.gains(np.array([1.0 if problem.ranges[i].name[0] == "s" else 0.0 for i in problem.searched]))
    rows = error_rows(problem.model, problem.bounds, quiet, 1e-9 * problem.box, np.zeros(len(problem.model.inputs)))
    made = []
    for share, ratio in product(OUTER_SHARES, SEPARATIONS):
        betas: list[float] = []
        widths: list[float] = []
        for k, i in enumerate(problem.law.governed):
            item, target = problem.ranges[4 * k], problem.law.rows[i].target
            per_gain = rows.control_gain[i] / (2 * rows.mass_high[i])
            # a row that tracks nothing is as fast as the row before it
            wanted = ratio * widths[-1] if isinstance(target, int) else widths[-1] if widths else 0.0
            beta = wanted / per_gain if widths else item.low * (item.high / item.low) ** share
            betas.append(min(max(float(f"{beta:.4g}"), item.low), item.high))
            widths.append(betas[-1] * per_gain)
        made.append(tuple(replace(g, beta=beta) for g, beta in zip(quiet, betas, strict=True)))
    return made


def search(
    problem: Problem, first: Selection, budget: tuple[int, int], seed: int, options: Options, state: State,
    progress: Progress,
) -> Found:  # fmt: skip
    """Stage two: the study's method over the proved set, with the closed-loop cost; then fewer digits.

    Args:
        problem: The study's problem.
        first: Where stage one ended.
        budget: Population, and evaluations of each candidate of the population.
        seed: Seed of the search.
        options: Workers.
        state: Keeps the population after each iteration.
        progress: Where to report.
    """
    population, rounds = budget
    allowed = Budget(evaluations=population * (rounds + 1), seconds=problem.study.tuning.seconds or math.inf)
    composed = isinstance(first.certificate, Composition)

    def after(now: Population) -> None:
        state.put("search", to_data(now))
        cost = now.outcomes[now.best].cost
        progress.update(
            now.evaluations / allowed.evaluations, f"best {cost:.4g}" if math.isfinite(cost) else "none proved yet"
        )

    method, start = problem.study.tuning.method, problem.point(first.gains)
    if method == "gradient":
        return _descended(problem, start, seed, allowed, composed, progress)
    with workers(make_evaluator, (problem.study, composed), options.jobs, options.cluster) as pool:
        found = run_search(
            method, pool.map, start, population, seed, allowed, restored=kept_population(state), after=after
        )
    best = best_of(found)
    if best is None:
        gains = problem.gains(found.points[found.best])
        return Found(gains=gains, best=None, evaluations=found.evaluations, runs=found.runs)
    return _shortened(problem, best, found.evaluations, found.runs, composed)


def _descended(problem: Problem, start: Array, seed: int, allowed: Budget, composed: bool, progress: Progress) -> Found:
    """Descent from the start and then from random points, until the budget is used; it is not resumed but repeated."""
    from .gradient import descent

    others = np.random.default_rng(seed).uniform(size=(allowed.evaluations, start.size))
    budget = replace(allowed, evaluations=allowed.evaluations - 1)
    tried, used = descent(
        problem, [start, *others], budget,
        lambda spent, cost: progress.update(spent / allowed.evaluations, f"best {cost:.4g}"),
    )  # fmt: skip
    point = tried[0] if tried else start
    (outcome,) = evaluate(problem, [problem.gains(point)], composed=composed)
    if not outcome.feasible:
        return Found(gains=problem.gains(point), best=None, evaluations=used + 1, runs=outcome.runs)
    return _shortened(problem, Best(point=point, outcome=outcome), used + 1, outcome.runs, composed)


def _shortened(problem: Problem, best: Best, evaluations: int, runs: int, composed: bool) -> Found:
    """The winner with as few digits as its proof and its cost allow."""
    gains = problem.gains(best.point)
    choices = [with_digits(problem, gains, digits) for digits in SHORT_DIGITS]
    short = shortest(choices, lambda some: evaluate(problem, some, composed=composed), best.outcome)
    if short is not None:
        gains = short[0]
        best = Best(point=problem.point(gains), outcome=short[1])
    return Found(gains=gains, best=best, evaluations=evaluations + len(choices), runs=runs)


def with_digits(axis: Axis, gains: tuple[Gains, ...], digits: int) -> tuple[Gains, ...]:
    """The gains as shorter decimals inside their ranges; those that the study fixes stay."""
    values = [getattr(g, kind) for g in gains for kind in KINDS]
    for i in axis.searched:
        values[i] = rounded(values[i], digits, axis.ranges[i].low, axis.ranges[i].high)
    return tuple(Gains(**dict(zip(KINDS, values[k : k + 4], strict=True))) for k in range(0, len(values), 4))


def to_data(state: Population) -> dict[str, Any]:
    """A population as JSON data."""
    return {
        "iteration": state.iteration,
        "points": state.points.tolist(),
        "outcomes": [
            [o.violation, o.cost if math.isfinite(o.cost) else None, list(o.objectives), o.runs] for o in state.outcomes
        ],
        "random": state.random,
        "evaluations": state.evaluations,
        "runs": state.runs,
    }


def kept_population(state: State) -> Population | None:
    """The population that a state holds, or None."""
    data = state.get("search")
    if data is None:
        return None
    return Population(
        iteration=data["iteration"],
        points=np.array(data["points"]),
        outcomes=tuple(
            Outcome(violation=v, cost=math.inf if c is None else c, objectives=tuple(o), runs=r)
            for v, c, o, r in data["outcomes"]
        ),
        random=data["random"],
        evaluations=data["evaluations"],
        runs=data["runs"],
    )
