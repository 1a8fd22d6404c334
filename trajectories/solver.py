"""IPOPT on the program of a motion, and the motion that its answer stands for."""

from __future__ import annotations

from functools import lru_cache, reduce
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .guess import Guess
from .passing import fixed
from .program import KEPT, Program
from .shape import Shape
from .spline import Spline, clamped_knots, joined
from .task import Task

Array = NDArray[np.float64]

_IPOPT = {
    "print_level": 0, "sb": "yes", "tol": 1e-8, "acceptable_iter": 0, "max_iter": 200, "mu_strategy": "adaptive",
    "honor_original_bounds": "yes",
}  # fmt: skip


#: Least duration of a phase, as a share of the guess.
FLOOR = 0.02
#: Further options where another start has failed before.
ELSEWHERE = (("max_iter", 100),)
#: Further options where the answer is worth no more than so much CPU time, s.
HURRY = (("max_cpu_time", 4.0),)
#: Further options where the search starts close to a solution.
NEAR = (
    ("mu_strategy", "monotone"), ("mu_init", 1e-4), ("bound_push", 1e-6), ("bound_frac", 1e-6),
    ("slack_bound_push", 1e-6), ("slack_bound_frac", 1e-6),
)  # fmt: skip
#: Further options where the search starts at the solution of nearly the same program.
AGAIN = (
    ("warm_start_init_point", "yes"), ("mu_strategy", "monotone"), ("mu_init", 1e-6), ("warm_start_bound_push", 1e-8),
    ("warm_start_mult_bound_push", 1e-8), ("warm_start_slack_bound_push", 1e-8), ("warm_start_bound_frac", 1e-8),
    ("warm_start_slack_bound_frac", 1e-8),
)  # fmt: skip


@lru_cache(maxsize=2 * KEPT)
def solver_of(program: Program, options: tuple[tuple[str, Any], ...] = ()) -> Any:
    """IPOPT on a program; `options` replace the usual ones. Kept as long as the program is."""
    import casadi as ca

    functions = {name: f for name, f in program.problem.items() if name != "nlp"}
    return ca.nlpsol(
        "motion", "ipopt", program.problem["nlp"],
        {**functions, "print_time": False, "error_on_fail": False, "no_nlp_grad": True,
         "calc_lam_p": False, "ipopt": {**_IPOPT, **dict(options)}},
    )  # fmt: skip


def bounds(task: Task, program: Program, start: Guess) -> dict[str, Array]:
    """Bounds of the variables: positions, what the waypoints give, durations."""
    shape = program.shape
    low, high = np.full(shape.size, -np.inf), np.full(shape.size, np.inf)
    least, most = task.limits.room
    for phase in range(shape.phases):
        for k in range(shape.count):
            places = shape.place(phase, np.arange(shape.controls), k)
            low[places], high[places] = least[k], most[k]
        at = shape.duration(phase)
        low[at] = FLOOR * start.durations[phase] if task.duration is None else 1e-3 * task.duration
        high[at] = task.longest if task.duration is None else task.duration
    if task.duration is not None and shape.phases == 1:
        low[shape.duration(0)] = task.duration
    low[shape.size - shape.slacks :] = 0.0
    for places, least_here, most_here in fixed(task, shape):
        if least_here < most_here:
            low[places], high[places] = np.maximum(low[places], least_here), np.minimum(high[places], most_here)
        else:
            low[places] = high[places] = least_here
    return {"lbx": low, "ubx": high}


def assembled(task: Task, shape: Shape, x: Array) -> tuple[Spline, tuple[float, ...]]:
    """The spline of a vector of variables from time 0, and the times at its waypoints."""
    points, durations = shape.unpacked(x)
    low, high = task.limits.room
    clock, splines = 0.0, []
    for own, duration in zip(points, durations, strict=True):
        knots = clamped_knots(clock, clock + float(duration), task.spans, task.degree)
        splines.append(Spline(knots=knots, coefficients=np.clip(own, low, high)))
        clock = splines[-1].end
    return reduce(joined, splines), tuple(s.end for s in splines)
