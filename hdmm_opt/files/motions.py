"""Motions of a machine as JSON data: splines with their bounds, and what they cost."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from trajectories import Motion

from ..motions.sequence import Motions
from ..study.motion import MotionStudy
from .text import csv_text

SCHEMA = "hdmm-opt/motions/1"
#: Time between two points of a joint trajectory, s.
STEP = 0.02


def document(study: MotionStudy, ways: Sequence[Motions]) -> dict[str, Any]:
    """The study, and every motion with knots [s], control points [rad, rad, m], bounds for all t and costs."""
    mover = ways[0].job.mover
    return {
        "schema": SCHEMA,
        "study": study.model_dump(mode="json", exclude_none=True),
        "joints": list(mover.names),
        "assumed": list(mover.assumed),
        "ways": [
            {
                "name": way.name,
                "duration_s": way.duration,
                "energy_j": way.totals.get("energy"),
                "lost_j": way.totals.get("loss"),
                "effort_s": way.totals["effort"],
                "efficiency": way.efficiency,
                "moves": [_move(motion, move.payload) for motion, move in zip(way.motions, way.job.moves, strict=True)],
            }
            for way in ways
        ],
    }


def _move(motion: Motion, payload: float) -> dict[str, Any]:
    quantities, peaks = motion.quantities, motion.peaks
    assert peaks is not None and quantities is not None
    rows = zip(
        quantities.names, quantities.units, peaks.lower, peaks.upper, quantities.lower, quantities.upper, strict=True
    )
    return {
        "payload_kg": payload,
        "arrivals_s": list(motion.arrivals),
        "points": _points(motion),
        "degree": motion.spline.degree,
        "knots_s": motion.spline.knots.tolist(),
        "control_points": motion.spline.coefficients.tolist(),
        "bounds": [
            {"name": name, "unit": unit, "lower": _known(low), "upper": _known(high),
             "lower_limit": _known(least), "upper_limit": _known(most)}
            for name, unit, low, high, least, most in rows
        ],
    }  # fmt: skip


def _points(motion: Motion) -> list[dict[str, Any]]:
    """A joint trajectory: positions, velocities and accelerations every `STEP` and at every waypoint, which says so."""
    passed = {0.0: 0, **{float(t): k for k, t in enumerate(motion.arrivals, 1)}}
    times = sorted({*passed, *np.arange(0.0, motion.spline.end - motion.spline.start, STEP).tolist()})
    at = motion.spline.start + np.array(times)
    rows = zip(times, *(motion.spline(at, order).tolist() for order in range(3)), strict=True)
    return [
        {"time_from_start_s": t, "positions": x, "velocities": v, "accelerations": a, "waypoint": passed.get(t)}
        for t, x, v, a in rows
    ]


def table(ways: Sequence[Motions]) -> str:
    """The points of all motions as CSV; the header carries the units."""
    orders = (("position", ""), ("speed", "/s"), ("acceleration", "/s^2"))
    mover = ways[0].job.mover
    joints = list(zip(mover.names, mover.limits.units, strict=True))
    heads = [f"{joint} {what} [{unit}{per}]" for what, per in orders for joint, unit in joints]
    rows = [
        (way.name, k, p["time_from_start_s"], "" if p["waypoint"] is None else p["waypoint"],
         *p["positions"], *p["velocities"], *p["accelerations"])
        for way in ways for k, motion in enumerate(way.motions, 1) for p in _points(motion)
    ]  # fmt: skip
    names = ("motion", "move", "time [s]", "waypoint", *heads)
    return csv_text(dict(zip(names, zip(*rows, strict=True), strict=True)))


def _known(value: float) -> float | None:
    """A number, or null for a limit that there is not."""
    return float(value) if abs(value) < float("inf") else None
