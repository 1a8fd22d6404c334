"""Optimal motions of the crane's joints, as splines of the strokes of its actuators."""

from __future__ import annotations

from typing import Any

import numpy as np

from trajectories import Spline
from trajectories.spline import clamped_knots, fitted

from ..machines.crane_dynamics import JOINTS, strokes
from ..machines.crane_geometry import LIFT, TILT
from ..machines.machine import Machine
from ..study import Study
from .crane_task import crane_mover
from .least_time import least_time


def crane_moves(study: Study, machine: Machine) -> list[list[Spline]]:
    """Minimum-time moves with a weight on jerk, between joint coordinates.

    The stroke is a smooth function of the joint: a spline through it on twice the spans is the reference from here on.

    Raises:
        InvalidInputError: a move that cannot be reached.
    """
    import casadi as ca

    section, locked = study.reference, study.plant.locked

    def whole(place: tuple[float, ...]) -> tuple[float, float, float]:
        given = dict(zip(machine.members, place, strict=True))
        if section.coordinates == "members":
            given = {name: _coordinate(name, value) for name, value in given.items()}
        first, second, third = (given[name] if name in given else _coordinate(name, locked[name]) for name in JOINTS)
        return (first, second, third)

    places = [whole(place) for place in section.waypoints]
    motions = least_time(study, crane_mover(), places)
    w = ca.SX.sym("w", 3)
    stroke = ca.Function("stroke", [w], [strokes(w)])
    kept = [k for k, name in enumerate(JOINTS) if name not in locked]
    return [_strokes(motion.spline, stroke, kept, 2 * section.spans) for motion in motions]


def _coordinate(name: str, stroke: float) -> float:
    """The joint coordinate of a locked actuator's stroke."""
    loops = {"lift": LIFT, "tilt": TILT}
    return float(loops[name].coordinate(stroke)) if name in loops else stroke


def _strokes(spline: Spline, stroke: Any, kept: list[int], spans: int) -> list[Spline]:
    knots = clamped_knots(spline.start, spline.end, spans)
    t = np.linspace(spline.start, spline.end, 40 * spans + 1)
    values = np.array(stroke.map(t.size)(spline(t).T)).T[:, kept]
    found = fitted(t, values, knots)
    points = found.coefficients.copy()
    points[:3], points[-3:] = values[0], values[-1]  # at rest at both ends, exactly
    return [Spline(knots=knots, coefficients=np.ascontiguousarray(points[:, k])) for k in range(points.shape[1])]
