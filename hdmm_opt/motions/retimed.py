"""Moves straight between joint coordinates by TOPP-RA and by Ruckig, checked for all t against every limit."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from trajectories import (
    LimitViolatedError,
    Motion,
    MotionLimits,
    Spline,
    bezier,
    jerk_limited,
    motion_of,
    peaks,
    retime,
    violations,
)
from trajectories.limits import ORDERS
from trajectories.quantity import Quantities

from .enclosure import enclosure
from .job import Job, Move, State

#: Intervals of TOPP-RA on a line.
GRID = 120
#: Shares of the limits of the joints that Ruckig is given, one after the other, until the drives are inside theirs.
SHARES = (1.0, 0.9, 0.8, 0.65, 0.5, 0.35, 0.25)


def retimed_motion(job: Job, at: State, goal: Any, move: Move, cost: Any) -> Motion:
    """The quickest move along the straight line of the joints, by TOPP-RA; the jerk is free.

    Raises:
        ValueError: it starts or ends moving.
        LimitViolatedError: the line cannot be followed inside the limits.

    Not guaranteed: quantities that depend on the jerk, such as voltages, are left out.
    """
    if at.speed is not None or move.speed is not None:
        raise ValueError("TOPP-RA moves from rest to rest here: got a speed")
    quantities = job.quantities(move.payload, jerk=False)
    still = dict.fromkeys(ORDERS.values(), np.inf)
    line = Spline(knots=np.array([0.0, 0, 1, 1]), coefficients=np.array([at.place, goal]))
    _reject(line, replace(job.limits, **still))
    found = retime(bezier([at.place, goal]), job.limits, enclosure, quantities, grid=GRID)
    points = at.place + found.law.coefficients[:, None] * (np.asarray(goal) - at.place)
    spline = Spline(knots=found.law.knots, coefficients=points)
    return _checked(job, spline, replace(job.limits, jerk=np.inf), quantities, cost)


def jerk_limited_motion(job: Job, at: State, goal: Any, move: Move, cost: Any) -> Motion:
    """The quickest move by Ruckig that the drives can follow: it is given less of the joints' limits until they can.

    Raises:
        ValueError: a limit of acceleration or jerk is missing.
        LimitViolatedError: the drives cannot follow with the least share.
    """
    quantities, reason = job.quantities(move.payload), ""
    for share in SHARES:
        sizes = {name: share * job.limits.of(order) for order, name in ORDERS.items()}
        limits = replace(job.limits, **sizes)
        try:
            spline = jerk_limited(at.place, goal, limits, speeds=(at.speed, move.speed), acceleration=at.acceleration)
            return _checked(job, spline, job.limits, quantities, cost)
        except LimitViolatedError as error:
            reason = str(error)
    raise LimitViolatedError(f'{reason}, with {SHARES[-1]:.0%} of the joints\' limits; use kind = "bspline"')


def _reject(spline: Spline, limits: MotionLimits) -> None:
    broken = violations(spline, limits)
    if broken:
        raise LimitViolatedError(broken[0])


def _checked(job: Job, spline: Spline, limits: MotionLimits, quantities: Quantities, cost: Any) -> Motion:
    """The motion, inside every limit for all t."""
    _reject(spline, limits)
    found = peaks(spline, quantities)
    if not found.inside:
        worst = int((found.excess.max(axis=1) / quantities.scale).argmax())
        excess = f"{found.excess[worst].max():.3g} {quantities.units[worst]}"
        raise LimitViolatedError(f"{quantities.names[worst]} is up to {excess} outside its limit")
    task = job.task((spline.coefficients[0], spline.coefficients[-1]), 0.0, cost=cost, quantities=quantities)
    return motion_of(task, spline, (spline.end,), found)
