"""The tick of a loop, and integration steps in it from the time constants of the plants."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from ..plants import Plant
from ..problem import Problem

#: Longest integration step as a share of the fastest time constant.
STEP_SHARE = 0.35
#: Longest integration step, s: between the control instants a loop is looked at this often.
LONGEST = 5e-4
#: Parts that a control period is cut into at most, so that inputs switch at ticks.
PARTS = 20


def tick_of(problem: Problem) -> float:
    """The shortest control period, or the part of it that divides delay and jitter; or a twentieth, nearly so."""
    period, bounds = problem.period, [member.bounds for member in problem.members]
    times = max(b.delay for b in bounds), max(b.jitter for b in bounds)
    for parts in range(1, PARTS + 1):
        ticks = [time / period * parts for time in times]
        if all(abs(count - round(count)) < 1e-6 for count in ticks):
            return period / parts
    return period / PARTS


def steps_of(plant: Plant, period: float, disturbances: Sequence[float]) -> int:
    """Integration steps in one tick, from the fastest time constant of a plant at its operating point.

    Args:
        plant: The plant, at nominal parameters.
        period: Duration of a tick, s.
        disturbances: Its disturbances there.
    """
    import casadi as ca

    jacobian = ca.Function("J", [plant.x, plant.u, plant.w, plant.p], [ca.jacobian(plant.rate, plant.x)])
    values = list(plant.values().values())
    at_work = np.array(jacobian(list(plant.operating), 0, list(disturbances), values))
    fastest = float(np.abs(np.linalg.eigvals(at_work)).max())
    return max(math.ceil(period / LONGEST - 1e-9), math.ceil(period * fastest / STEP_SHARE))
