"""Where the search for a motion starts."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from .limits import ORDERS
from .quintic import law, shortest_duration
from .spline import clamped_knots, fitted
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
    """

    points: tuple[Array, ...]
    durations: Array


def unit_times(task: Task) -> Array:
    """Shares of a phase's time at which a guess is sampled. Shape (m,)."""
    return np.linspace(0.0, 1.0, 8 * (task.spans + task.degree))


def fitted_controls(task: Task, values: Array) -> Array:
    """Control points of a phase, inside the ranges of the coordinates, from samples at `unit_times`, shape (m, n)."""
    knots = clamped_knots(0.0, 1.0, task.spans, task.degree)
    return np.clip(fitted(unit_times(task), values, knots, task.degree).coefficients, *task.limits.room)


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
    return Guess(points=tuple(points), durations=share * np.array(durations))


def _duration(task: Task, distance: Array) -> float:
    """Time for the coordinate that takes longest, s."""
    limits = np.stack([task.limits.of(order) for order in ORDERS], axis=1)
    quickest = max(
        shortest_duration(float(d), *(float(v) for v in own)) for d, own in zip(distance, limits, strict=True)
    )
    return max(EASE * quickest, 1e-3 * task.longest) if np.isfinite(limits).any() else UNKNOWN * task.longest
