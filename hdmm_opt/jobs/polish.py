"""The last stage of a search: a pattern search around the winner, judged by refined certificates.

Candidates of a search are judged with the inertias in few cells, which asks for more torque than is needed and so keeps
gains low. Where the checker has no time for cells of all members, the winner stays.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ..problem import Problem
from ..simulation import Loop
from .certify import refinable
from .evaluation import evaluate
from .options import Progress
from .start import Tuned

#: Steps in the unit cube of the ranges, and candidates at most.
STEPS, MOST = (0.08, 0.03), 60


def polished(problem: Problem, tuned: Tuned, progress: Progress) -> Tuned:
    """Better gains nearby, by refined certificates; the same where there are none, or where nothing is refined."""
    if not refinable(problem) or not problem.searched:
        return tuned
    loop, best = Loop(problem), problem.point(tuned.gains)
    (outcome,) = evaluate(loop, [tuned.gains], refine=True)
    gains, spent, runs = tuned.gains, 1, outcome.runs
    for step in STEPS:
        better = True
        while better and spent < MOST:
            points = [np.clip(best + sign * step * axis, 0.0, 1.0) for axis in np.eye(best.size) for sign in (1, -1)]
            choices = [problem.at(point) for point in points]
            found = evaluate(loop, choices, refine=True)
            spent, runs = spent + len(points), runs + sum(o.runs for o in found)
            k = min(range(len(found)), key=lambda i: (found[i].violation, found[i].cost))
            better = (found[k].violation, found[k].cost) < (outcome.violation, outcome.cost)
            if better:
                best, outcome, gains = points[k], found[k], choices[k]
            progress.update(spent / MOST, f"best {outcome.cost:.4g}")
    return replace(tuned, gains=gains, evaluations=tuned.evaluations + spent, runs=tuned.runs + runs)
