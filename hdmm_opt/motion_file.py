"""Motions of a machine as JSON data: splines with their bounds, and what they cost."""

from __future__ import annotations

from typing import Any

from trajectories import Motion

from .bilevel import Bilevel
from .crane_task import ASSUMED, drive_quantities
from .motion_study import MotionStudy
from .plants.crane_dynamics import JOINTS

SCHEMA = "hdmm-opt/motions/1"


def document(study: MotionStudy, found: Bilevel) -> dict[str, Any]:
    """The study, and every motion with knots [s], control points [rad, rad, m], bounds for all t and costs."""
    return {
        "schema": SCHEMA,
        "study": study.model_dump(mode="json", exclude_none=True),
        "joints": list(JOINTS),
        "assumed": list(ASSUMED),
        "evaluations": found.evaluations,
        "references": [
            {
                "name": motions.name,
                "duration_s": motions.duration,
                "energy_j": motions.totals["energy"],
                "lost_j": motions.totals["loss"],
                "effort_s": motions.totals["effort"],
                "efficiency": motions.efficiency,
                "moves": [_move(m, payload) for m, payload in zip(motions.motions, motions.payloads, strict=True)],
            }
            for motions in found.references
        ],
    }


def _move(motion: Motion, payload: float) -> dict[str, Any]:
    quantities, peaks = drive_quantities(payload), motion.peaks
    assert peaks is not None
    return {
        "payload_kg": payload,
        "degree": motion.spline.degree,
        "knots_s": motion.spline.knots.tolist(),
        "control_points": motion.spline.coefficients.tolist(),
        "bounds": [
            {"name": name, "unit": unit, "lower": float(low), "upper": float(high), "limit": float(limit)}
            for name, unit, low, high, limit in zip(
                quantities.names, quantities.units, peaks.lower, peaks.upper, quantities.upper, strict=True
            )
        ],
    }
