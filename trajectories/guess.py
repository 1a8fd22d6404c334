"""Where the search for a motion starts."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from .limits import ORDERS
from .quintic import law, shortest_duration
from .spline import Spline, clamped_knots, fitted
from .task import Task

Array = NDArray[np.float64]

#: A first guess takes this much longer than the quickest move by the limits of the coordinates.
EASE = 1.5
#: Share of the admissible time that the first guess takes where no coordinate has limits.
UNKNOWN = 0.25
#: Bends tried where straight lines fail, as shares of the room beside the line.
BENDS = (0.0, 0.5, -0.5)


@dataclass(frozen=True, kw_only=True)
class Guess:
    """Control points and durations.

    Attributes:
        points: Control points of every phase. Each shape (k, n).
        durations: Durations of the phases, s. Shape (phases,).
        near: Whether a motion inside the limits is close by: the search then stays there.
    """

    points: tuple[Array, ...]
    durations: Array
    near: bool = False


def unit_times(task: Task) -> Array:
    """Shares of a phase's time at which a guess is sampled. Shape (m,)."""
    return np.linspace(0.0, 1.0, 8 * (task.spans + task.degree))


def fitted_controls(task: Task, values: Array) -> Array:
    """Control points of a phase, inside the ranges of the coordinates, from samples at `unit_times`, shape (m, n)."""
    knots = clamped_knots(0.0, 1.0, task.spans, task.degree)
    return np.clip(fitted(unit_times(task), values, knots, task.degree).coefficients, *task.limits.room)


def moving_ends(task: Task, points: Array, duration: float, phase: int) -> Array:
    """Control points of a phase, the first and the last ones those of the speeds and accelerations of its waypoints."""
    found, count, degree = points.copy(), points.shape[1], task.degree
    for number, order in ((0, 1), (task.phases, -1)):
        waypoint = task.waypoints[number]
        if waypoint.moving and phase == (0 if order > 0 else task.phases - 1):
            own = found[::order]  # a view: seen from the end, speeds change their sign
            step = order * duration * waypoint.rate(1, count) / (degree * task.spans)
            bend = duration**2 * waypoint.rate(2, count) / (degree * (degree - 1) * task.spans**2)
            own[1] = own[0] + step
            own[2] = own[1] + 2 * (step + bend)
    return found


def remaining(task: Task, spline: Spline, times: Array) -> Guess:
    """Another motion as a guess.

    Args:
        task: The task.
        spline: The motion; it rests beyond its ends.
        times: When the motion is at the waypoints, s. Shape (waypoints,).
    """
    points, durations = [], np.diff(times)
    for phase, (begin, duration) in enumerate(zip(times[:-1], durations, strict=True)):
        own = fitted_controls(task, spline(begin + duration * unit_times(task)))
        points.append(moving_ends(task, own, float(duration), phase))
    return Guess(points=tuple(points), durations=durations, near=True)


def guesses(task: Task) -> Iterator[Guess]:
    """Moves along straight lines between the waypoints, then along bent ones."""
    for bend in BENDS:
        yield straight(task, bend)


def straight(task: Task, bend: float = 0.0) -> Guess:
    """Quintic moves between the waypoints, all coordinates at once.

    Args:
        task: The task.
        bend: How far the middle leaves the line, as a share of the room to the limits of each coordinate.
    """
    low, high = task.limits.room
    way = law(unit_times(task))[:, None]
    points, durations = [], []
    for before, after in pairwise(task.waypoints):
        line = before.guess + way * (after.guess - before.guess)
        edge = np.where(bend > 0, high, low)
        edge = np.where(np.isfinite(edge), edge, line)
        path = line + abs(bend) * 4 * way * (1 - way) * (edge - line)
        points.append(fitted_controls(task, path))
        durations.append(_duration(task, after.guess - before.guess))
    share = task.duration / sum(durations) if task.duration is not None else min(1.0, task.longest / sum(durations))
    times = share * np.array(durations)
    ends = (moving_ends(task, own, float(times[k]), k) for k, own in enumerate(points))
    return Guess(points=tuple(ends), durations=times)


def _duration(task: Task, distance: Array) -> float:
    """Time for the coordinate that takes longest, s."""
    limits = np.stack([task.limits.of(order) for order in ORDERS], axis=1)
    quickest = max(
        shortest_duration(float(d), *(float(v) for v in own)) for d, own in zip(distance, limits, strict=True)
    )
    return max(EASE * quickest, 1e-3 * task.longest) if np.isfinite(limits).any() else UNKNOWN * task.longest
