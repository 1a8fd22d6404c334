"""Stage two of the gain selection: the study's method over the proved set by closed-loop cost; then fewer digits."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from tuning import Best, Budget, Population, best_of
from tuning import search as run_search
from tuning.decimals import shortest

from ..files.state import State
from ..problem import GainSet, Problem
from ..simulation import Loop
from .certify import contracts_of
from .checkpoint import kept_population, to_data
from .evaluation import evaluate, make_evaluator
from .options import Options, Progress
from .space import Window
from .start import Tuned
from .workers import workers

Array = NDArray[np.float64]

#: Significant digits that the winner's gains may shrink to, fewest first.
SHORT_DIGITS = (2, 3)


def search(
    problem: Problem, first: Tuned, method: str, budget: tuple[int, int], seed: int, options: Options, state: State,
    progress: Progress, *, refine: bool = False,
) -> Tuned:  # fmt: skip
    """Search from a start until the budget is used.

    Args:
        problem: The problem.
        first: Where stage one ended.
        method: "jaya", "tlbo", "random" or "gradient".
        budget: Population, and evaluations of each candidate of the population.
        seed: Seed of the search.
        options: Workers.
        state: Keeps the population after each iteration.
        progress: Where to report.
        refine: Judge candidates by refined certificates, which are three times dearer and let gains be higher; not by
            "gradient".

    Returns:
        The best gains that were met; their proofs where they are proved.
    """
    population, rounds = budget
    allowed = Budget(evaluations=population * (rounds + 1), seconds=problem.study.tuning.seconds or math.inf)
    start = problem.point(first.gains)
    if method == "gradient":
        return _descended(problem, first, start, seed, allowed, progress)

    def after(now: Population) -> None:
        state.put("search", to_data(now))
        cost = now.outcomes[now.best].cost
        text = f"best {cost:.4g}" if math.isfinite(cost) else "none yet that is proved and meets its requirements"
        progress.update(now.evaluations / allowed.evaluations, text)

    window = Window.around(problem, start)
    arguments = (problem.study, window, refine)
    with workers(make_evaluator, arguments, options.jobs, options.cluster) as pool:
        found = run_search(
            method, pool.map, window.local(start), population, seed, allowed, restored=kept_population(state),
            after=after,
        )  # fmt: skip
    best = best_of(found)
    spent = replace(first, evaluations=found.evaluations, runs=found.runs)
    if best is None:
        return _proved(problem, replace(spent, gains=problem.at(window.at(found.points[found.best]))), refine)
    return _shortened(problem, spent, replace(best, point=window.at(best.point)), refine)


def _descended(problem: Problem, first: Tuned, start: Array, seed: int, allowed: Budget, progress: Progress) -> Tuned:
    """Descent from the start and then from random points, until the budget is used; it is not resumed but repeated."""
    from .gradient import descent

    others = np.random.default_rng(seed).uniform(size=(allowed.evaluations, start.size))
    budget = replace(allowed, evaluations=allowed.evaluations - 1)
    loop = Loop(problem)
    tried, used = descent(
        loop, [start, *others], budget,
        lambda spent, cost: progress.update(spent / allowed.evaluations, f"best {cost:.4g}"),
    )  # fmt: skip
    point = tried[0] if tried else start
    (outcome,) = evaluate(loop, [problem.at(point)])
    spent = replace(first, gains=problem.at(point), evaluations=used + 1, runs=outcome.runs)
    if not outcome.feasible:
        return _proved(problem, spent)
    return _shortened(problem, spent, Best(point=point, outcome=outcome))


def _shortened(problem: Problem, spent: Tuned, best: Best, refine: bool = False) -> Tuned:
    """The winner with as few digits as its proof and its cost allow."""
    gains, loop = problem.at(best.point), Loop(problem)
    choices = [
        {member.name: member.shortened(gains[member.name], digits) for member in problem.members}
        for digits in SHORT_DIGITS
    ]
    short = shortest(choices, lambda some: evaluate(loop, some, refine=refine), best.outcome)
    kept: GainSet = gains if short is None else short[0]
    return _proved(problem, replace(spent, gains=kept, evaluations=spent.evaluations + len(choices)), refine)


def _proved(problem: Problem, tuned: Tuned, refine: bool = False) -> Tuned:
    contracts = contracts_of(problem, tuned.gains, refine=refine)
    return replace(tuned, contracts=contracts)
