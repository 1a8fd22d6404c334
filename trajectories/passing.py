"""What waypoints ask of a motion: variables that are fixed, rows of the program, and the values that the rows take.

The rows hold no numbers of a task, so tasks that differ in places, speeds and times alone share a program.
"""

from __future__ import annotations

from collections.abc import Iterator
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .shape import Shape
from .task import Task, Waypoint

Array = NDArray[np.float64]


def pattern(task: Task) -> tuple[Any, ...]:
    """What the rows of a task's waypoints depend on; equal for tasks that may share a program."""
    ends = (task.waypoints[0], task.waypoints[-1])
    return (
        tuple(w.through and (w.through, tuple(w.asked)) for w in task.waypoints),
        tuple((end.moving, tuple(np.isnan(end.known))) for end in ends),
    )


def rows(task: Task, phases: list[Any], maps: list[Any]) -> list[Any]:
    """Columns of the program: places that functions give, speed and acceleration at the ends, junctions of phases."""
    import casadi as ca

    found = []
    for k, waypoint in enumerate(task.waypoints):
        points, _ = phases[min(k, task.phases - 1)]
        if waypoint.through is not None:
            there = waypoint.through((points[0, :] if k < task.phases else points[-1, :]).T)
            found.append(ca.vertcat(*(there[int(i)] for i in waypoint.asked)))
    for waypoint, (points, duration), edge, inwards in _ends(task, phases):
        at = 0 if edge == 0 else points.shape[0] - 1
        if waypoint.moving:
            found += [(maps[order][edge, :] @ points / duration**order).T for order in range(1, task.rest)]
            continue
        free = [int(i) for i in np.flatnonzero(np.isnan(waypoint.known))]
        found += [ca.vertcat(*(points[at + inwards * j, i] - points[at, i] for i in free)) for j in range(1, task.rest)]
    for (before, t), (after, u) in pairwise(phases):
        for order in range(3):
            stop, start = maps[order][-1, :] @ before, maps[order][0, :] @ after
            found.append((stop * (u / t) ** order - start).T if order else (stop - start).T)
    return found


def row_values(task: Task) -> tuple[Array, Array]:
    """Lower and upper ends of the rows, in the order of `rows`."""
    count = len(task.limits.names)
    low, high = [np.zeros(0)], [np.zeros(0)]
    for waypoint in task.waypoints:
        if waypoint.through is not None:
            least, most = waypoint.ends
            low.append(least[waypoint.asked])
            high.append(most[waypoint.asked])
    for waypoint, _, _, _ in _ends(task, [None] * task.phases):
        if waypoint.moving:
            parts = [waypoint.rate(order, count) for order in range(1, task.rest)]
        else:
            parts = [np.zeros(int(np.isnan(waypoint.known).sum()))] * (task.rest - 1)
        low += parts
        high += parts
    meeting = np.zeros(3 * count * (task.phases - 1))
    return np.concatenate([*low, meeting]), np.concatenate([*high, meeting])


def _ends(task: Task, phases: list[Any]) -> Iterator[tuple[Waypoint, Any, int, int]]:
    yield task.waypoints[0], phases[0], 0, 1
    yield task.waypoints[-1], phases[-1], -1, -1


def fixed(task: Task, shape: Shape) -> list[tuple[Any, float, float]]:
    """Places of the variables that waypoints give, and the ends of what they give."""
    found = []
    for number, waypoint in enumerate(task.waypoints):
        if waypoint.through is not None:
            continue
        for k, (low, high) in enumerate(zip(*waypoint.ends, strict=True)):
            if np.isnan(low):
                continue
            still = task.rest if not waypoint.moving and low == high else 1
            if number < shape.phases:
                found.append((shape.place(number, np.arange(still if number == 0 else 1), k), low, high))
            if number > 0:
                reach = still if number == shape.phases else 1
                found.append((shape.place(number - 1, shape.controls - 1 - np.arange(reach), k), low, high))
    return found
