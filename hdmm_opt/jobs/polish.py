"""The last stage of a search: a pattern search around the winner, judged by refined certificates.

Candidates of a search are judged with the inertias in few cells, which asks for more torque than is needed and so keeps
gains low. Where the checker has no time for cells of all members, the winner stays.
"""

from __future__ import annotations

from dataclasses import replace
from itertools import combinations

import numpy as np
from numpy.typing import NDArray

from ..problem import Problem
from ..simulation import Loop
from .certify import refinable
from .evaluation import evaluate, make_evaluator
from .options import Options, Progress
from .space import Window
from .start import Tuned
from .workers import workers

Array = NDArray[np.float64]

#: Steps in the unit cube of the ranges, and candidates at most.
STEPS, MOST = (0.08, 0.03, 0.012), 240


def polished(problem: Problem, tuned: Tuned, options: Options, progress: Progress) -> Tuned:
    """Better gains nearby, by refined certificates; the same where there are none, or where nothing is refined."""
    if not refinable(problem) or not problem.searched:
        return tuned
    best = problem.point(tuned.gains)
    (outcome,) = evaluate(Loop(problem), [tuned.gains], refine=True)
    around, spent, runs, first = directions(problem), 1, outcome.runs, best
    window = Window(low=np.zeros(best.size), high=np.ones(best.size))
    with workers(make_evaluator, (problem.study, window, True), options.jobs, options.cluster) as pool:
        for step in STEPS:
            better = True
            while better and spent < MOST:
                points = [np.clip(best + step * way, 0.0, 1.0) for way in around]
                found = pool.map(points)
                spent, runs = spent + len(points), runs + sum(o.runs for o in found)
                k = min(range(len(found)), key=lambda i: found[i].rank())
                better = found[k].rank() < outcome.rank()
                if better:
                    best, outcome = points[k], found[k]
                progress.update(min(spent / MOST, 1.0), f"best {outcome.cost:.4g}")
    gains = tuned.gains if best is first else problem.at(best)
    return replace(tuned, gains=gains, evaluations=tuned.evaluations + spent, runs=tuned.runs + runs)


def directions(problem: Problem) -> list[Array]:
    """Both ways along every gain, and along every pair of a member's: a limit that binds lets gains move together."""
    axes, found, first = np.eye(problem.searched), [], 0
    for group in problem.groups:
        own = axes[first : first + len(group[0].searched)]
        first += len(own)
        found += [*own, *((a + sign * b) / np.sqrt(2) for a, b in combinations(own, 2) for sign in (1, -1))]
    return [sign * way for way in found for sign in (1, -1)]
