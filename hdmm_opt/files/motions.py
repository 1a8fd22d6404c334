"""Motions of a machine as JSON data: splines with their bounds, and what they cost."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from trajectories import Motion

from ..machines.crane_dynamics import JOINTS
from ..motions.crane_task import ASSUMED, drive_quantities
from ..motions.sequence import Job, Motions
from ..study.motion import MotionStudy

SCHEMA = "hdmm-opt/motions/1"


def document(study: MotionStudy, ways: Sequence[Motions]) -> dict[str, Any]:
    """The study, and every motion with knots [s], control points [rad, rad, m], bounds for all t and costs."""
    return {
        "schema": SCHEMA,
        "study": study.model_dump(mode="json", exclude_none=True),
        "joints": list(JOINTS),
        "assumed": list(ASSUMED),
        "ways": [
            {
                "name": way.name,
                "duration_s": way.duration,
                "energy_j": way.totals["energy"],
                "lost_j": way.totals["loss"],
                "effort_s": way.totals["effort"],
                "efficiency": way.efficiency,
                "moves": [
                    _move(way.job, motion, move.payload)
                    for motion, move in zip(way.motions, way.job.moves, strict=True)
                ],
            }
            for way in ways
        ],
    }


def _move(job: Job, motion: Motion, payload: float) -> dict[str, Any]:
    quantities, peaks = drive_quantities(payload, job.obstacles), motion.peaks
    assert peaks is not None
    rows = zip(
        quantities.names, quantities.units, peaks.lower, peaks.upper, quantities.lower, quantities.upper, strict=True
    )
    return {
        "payload_kg": payload,
        "arrivals_s": list(motion.arrivals),
        "degree": motion.spline.degree,
        "knots_s": motion.spline.knots.tolist(),
        "control_points": motion.spline.coefficients.tolist(),
        "bounds": [
            {"name": name, "unit": unit, "lower": _known(low), "upper": _known(high),
             "lower_limit": _known(least), "upper_limit": _known(most)}
            for name, unit, low, high, least, most in rows
        ],
    }  # fmt: skip


def _known(value: float) -> float | None:
    """A number, or null for a limit that there is not."""
    return float(value) if abs(value) < float("inf") else None
