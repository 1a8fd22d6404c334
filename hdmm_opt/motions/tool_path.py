"""Motions whose tool follows a prescribed path within a tolerance; the joints share the work freely.

The path coordinate s is one more coordinate of the motion, and the tool's distance from the path at s a quantity of it.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import casadi as ca
import numpy as np

from trajectories import Guess, LimitViolatedError, Motion, MotionLimits, Path, Quantities, Spline, Task, Waypoint
from trajectories import bezier as curve
from trajectories.guess import fitted_controls, unit_times
from trajectories.quintic import law

from ..errors import InvalidInputError
from .enclosure import enclosure
from .job import Job, Move, State

#: Places on the path at which postures are looked for.
STEPS = 101


def path_task(job: Job, move: Move, at: State, cost: Any, spans: int) -> tuple[Task, Guess]:
    """A motion along a path of the tool from rest to rest.

    Args:
        job: The job.
        move: A move with a `path`, a `tolerance`, and with an `angle` an `angle_tolerance`.
        at: Where it starts.
        cost: Its cost, of the joints.
        spans: Spans of the spline.

    Returns:
        The task, and a guess whose tool is on the path. The task's last coordinate is that of the path.

    Raises:
        InvalidInputError: a tolerance that is not positive, a start that is not at rest, or a path that cannot be
            reached.
    """
    if not move.tolerance > 0 or (move.angle is not None and not move.angle_tolerance > 0):
        raise InvalidInputError(
            f"a path is followed within a positive tolerance: got {move.tolerance:g} m and {move.angle_tolerance:g} "
            "rad; widen it"
        )
    if at.speed is not None:
        raise InvalidInputError("a path starts at rest: got a speed; end the move before it without one")
    path = _path(job, move, at)
    joints, count = job.limits, len(job.start)
    low, high = joints.room
    limits = MotionLimits(
        position=(np.append(low, 0.0), np.append(high, 1.0)),
        speed=np.append(joints.of(1), np.inf), acceleration=np.append(joints.of(2), np.inf),
        jerk=np.append(joints.of(3), np.inf), names=(*joints.names, "path"), units=(*joints.units, "1"),
    )  # fmt: skip
    places = _along(job, path, at.place)
    task = Task(
        waypoints=(
            Waypoint(value=np.append(at.place, 0.0)),
            Waypoint(value=np.array([np.nan] * count + [1.0]), near=np.append(places[-1], 1.0)),
        ),
        limits=limits, quantities=_quantities(job, move, path), cost=_cost(cost, count), longest=job.longest,
        spans=spans,
    )  # fmt: skip
    return task, _guess(task, places)


def along_joints(motion: Motion, count: int) -> Motion:
    """The motion without the path coordinate."""
    spline = motion.spline
    return replace(motion, spline=Spline(knots=spline.knots, coefficients=spline.coefficients[:, :count]))


def _path(job: Job, move: Move, at: State) -> Path:
    """Place of the tool, and its angle where the move gives one, over the path coordinate."""
    here, count = job.mover.place(at.place), len(job.mover.coordinates)
    s = ca.SX.sym("s")
    value = curve(np.array([here[:count], *move.path])).function(s)
    if move.angle is not None:
        value = ca.vertcat(value, here[count] + s * (move.angle - here[count]))
    return Path(function=ca.Function("path", [s], [value]))


def _along(job: Job, path: Path, first: np.ndarray) -> np.ndarray:
    """Joint coordinates on the path, each near the one before. Shape (STEPS, n)."""
    found = [first]
    for s in np.linspace(0.0, 1.0, STEPS)[1:]:
        place = path([s])[0]
        value = np.append(place, [np.nan] * (job.mover.pose.numel_out(0) - len(place)))
        try:
            found.append(job.near(value, found[-1]))
        except LimitViolatedError:
            raise InvalidInputError(
                f"the tool reaches its path: it cannot at {job.mover.said(value)}, {100 * s:.0f} % of it; "
                "start with another posture, or move the path"
            ) from None
    return np.array(found)


def _quantities(job: Job, move: Move, path: Path) -> Quantities:
    given, count = job.quantities(move.payload), len(job.mover.coordinates)
    curves = [ca.SX.sym(name, len(job.start) + 1) for name in "xvaj"]
    pose, wanted = job.mover.pose(curves[0][:-1]), path.function(curves[0][-1])
    # half of 1 less the squared share: near the tolerance the share of it that is left, and smooth on the path
    off = [(ca.sumsqr(pose[:count] - wanted[:count]) / move.tolerance**2, "share of the tolerance that is left")]
    if move.angle is not None:
        share = (pose[count] - wanted[count]) ** 2 / move.angle_tolerance**2
        off.append((share, "share of the angle's tolerance that is left"))
    rooms = [(1 - square) / 2 for square, _ in off]
    function = ca.Function("path", curves, [ca.densify(ca.vertcat(given.function(*(c[:-1] for c in curves)), *rooms))])
    return Quantities(
        function=function,
        names=(*given.names, *(name for _, name in off)),
        units=(*given.units, *("1" for _ in off)),
        lower=np.append(given.lower, np.zeros(len(off))),
        upper=np.append(given.upper, np.full(len(off), np.inf)),
        enclose=enclosure(function),
    )


def _cost(cost: Any, count: int) -> Any:
    """The cost of a motion with the path coordinate."""
    if cost.running is None:
        return cost
    curves = [ca.SX.sym(name, count + 1) for name in "xvaj"]
    return replace(cost, running=ca.Function("costs", curves, [cost.running(*(c[:-1] for c in curves))]))


def _guess(task: Task, places: np.ndarray) -> Guess:
    """Along the places with a quintic law, in the time that the limits of the joints take for the whole way."""
    done = law(unit_times(task))
    shares = np.linspace(0.0, 1.0, len(places))
    values = np.stack([np.interp(done, shares, column) for column in places.T] + [done], axis=1)
    way = np.abs(np.diff(places, axis=0)).sum(axis=0)
    duration = 3.0 * float((way / task.limits.of(1)[:-1]).max()) + 1.0
    duration = min(duration, task.longest) if task.duration is None else task.duration
    return Guess(points=(fitted_controls(task, values),), durations=np.array([duration]))
