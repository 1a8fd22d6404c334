"""Motions of the crane whose tool follows a prescribed path within a tolerance; the joints share the work freely.

The path coordinate s is a fourth coordinate of the motion, and the tool's distance from the path at s a quantity of it.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import casadi as ca
import numpy as np

from trajectories import Guess, MotionLimits, Path, Quantities, Task, Waypoint
from trajectories.guess import fitted_controls, unit_times
from trajectories.quintic import law

from ..errors import InvalidInputError
from ..machines.crane_geometry import apart, reach, tool
from ..machines.crane_limits import joint_limits
from .crane_task import drive_quantities
from .enclosure import enclosure


def tool_path_task(
    path: Path, start: Sequence[float], *, tolerance: float, payload: float = 0.0, **options: Any
) -> tuple[Task, Guess]:
    """The quickest motion, or that of another cost, along a path of the tool from rest to rest.

    Args:
        path: Path of the tool in the plane of the crane, s -> (2,), m.
        start: Joint coordinates at its start, rad, rad, m; the tool must be there. The end's are free.
        tolerance: Largest distance of the tool from the path, m, for all t.
        payload: Mass at the tool, kg, beside the end mass.
        options: Further entries of `Task`. A running cost takes the four coordinates.

    Returns:
        The task, and a guess whose tool is on the path with the extension of the start.

    Raises:
        InvalidInputError: a tolerance that is not positive, a start off the path, or a path that cannot be reached
            with the extension of the start.
    """
    if not tolerance > 0:
        raise InvalidInputError(f"a path is followed within a positive tolerance: got {tolerance:g} m; widen it")
    first = np.asarray(start, dtype=float)
    off = apart(first, path([0.0])[0])
    if not off <= tolerance:
        raise InvalidInputError(
            f"the tool starts on its path: got {off:.4g} m beside it, the tolerance is {tolerance:g} m; "
            "move the start of one of them"
        )
    joints = joint_limits()
    low, high = joints.room
    limits = MotionLimits(
        position=(np.append(low, 0.0), np.append(high, 1.0)),
        speed=np.append(joints.of(1), np.inf), acceleration=np.append(joints.of(2), np.inf),
        jerk=np.append(joints.of(3), np.inf), names=(*joints.names, "path"), units=(*joints.units, "1"),
    )  # fmt: skip
    places = _along(path, first)
    task = Task(
        waypoints=(
            Waypoint(value=np.append(first, 0.0)),
            Waypoint(value=np.array([np.nan] * 3 + [1.0]), near=np.append(places[-1], 1.0)),
        ),
        limits=limits,
        quantities=_quantities(path, tolerance, payload),
        **options,
    )
    return task, _guess(task, places)


def _along(path: Path, first: np.ndarray) -> np.ndarray:
    """Joint coordinates on the path with the extension of the start. Shape (points, 3)."""
    joints = joint_limits()
    found = [first]
    for s in np.linspace(0.0, 1.0, 101)[1:]:
        place = path([s])[0]
        w = reach(place, float(first[2]), found[-1])
        if w is None or not joints.holds(w):
            raise InvalidInputError(
                f"the tool reaches its path with the extension of the start, {first[2]:g} m: it cannot at "
                f"({place[0]:.4g}, {place[1]:.4g}) m, {100 * s:.0f} % of it; "
                "start with another extension, or move the path"
            )
        found.append(w)
    return np.array(found)


def _quantities(path: Path, tolerance: float, payload: float) -> Quantities:
    drives = drive_quantities(float(payload))
    curves = [ca.SX.sym(name, 4) for name in "xvaj"]
    place = ca.vertcat(*tool(curves[0][:3]))
    away = ca.sumsqr(place - path.function(curves[0][3]))
    # as the clearance of a ball: a distance near the tolerance, and smooth on the path
    room = (tolerance**2 - away) / (2 * tolerance)
    function = ca.Function("path", curves, [ca.densify(ca.vertcat(drives.function(*(c[:3] for c in curves)), room))])
    return Quantities(
        function=function,
        names=(*drives.names, "room to the tolerance"),
        units=(*drives.units, "m"),
        lower=np.append(drives.lower, 0.0),
        upper=np.append(drives.upper, np.inf),
        enclose=enclosure(function),
    )


def _guess(task: Task, places: np.ndarray) -> Guess:
    """Along the places with a quintic law, in the time that the limits of the joints take for the whole way."""
    done = law(unit_times(task))
    shares = np.linspace(0.0, 1.0, len(places))
    values = np.stack([np.interp(done, shares, column) for column in places.T] + [done], axis=1)
    way = np.abs(np.diff(places, axis=0)).sum(axis=0)
    duration = 3.0 * float((way / task.limits.of(1)[:3]).max()) + 1.0
    duration = min(duration, task.longest) if task.duration is None else task.duration
    return Guess(points=(fitted_controls(task, values),), durations=np.array([duration]))
