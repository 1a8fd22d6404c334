"""Limits for all t: what holds on control points holds everywhere; other limits are enclosed span by span."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .spline import DEGREE, Spline

Array = NDArray[np.float64]

#: How often a span may be bisected while its effort is not yet shown to be inside its limit.
DEPTH = 10

#: Encloses effort quantities over ranges of position, speed, acceleration and jerk: (4 ranges) -> upper bounds.
Enclosure = Callable[[list[tuple[float, float]]], list[float]]


class LimitViolatedError(Exception):
    """A reference breaks a limit; the message says which, where, by how much, and what would do."""


@dataclass(frozen=True, kw_only=True)
class MotionLimits:
    """Limits of one axis.

    Attributes:
        speed: Largest |x'|, m/s.
        acceleration: Largest |x''|, m/s².
        jerk: Largest |x'''|, m/s³.
        position: Admissible positions, m.
    """

    speed: float
    acceleration: float
    jerk: float
    position: tuple[float, float]


def violations(spline: Spline, limits: MotionLimits) -> list[str]:
    """Motion limits that the control points do not respect, as text; empty where all hold for all t."""
    found = []
    low, high = spline.bounds(0)
    if low < limits.position[0] or high > limits.position[1]:
        found.append(
            f"position {low:.4g}…{high:.4g} m leaves the stroke {limits.position[0]:g}…{limits.position[1]:g} m"
        )
    for order, (name, limit, unit) in enumerate(
        (
            ("speed", limits.speed, "m/s"),
            ("acceleration", limits.acceleration, "m/s^2"),
            ("jerk", limits.jerk, "m/s^3"),
        ),
        1,
    ):
        size = max(abs(edge) for edge in spline.bounds(order))
        if not size <= limit * (1 + 1e-9):
            found.append(f"{name} {size:.4g} {unit} is over the limit {limit:g} {unit}")
    return found


def effort_peaks(spline: Spline, enclose: Enclosure, limits: Sequence[float]) -> list[float]:
    """Upper bounds on effort quantities for all t, by bisection of the spans where the limits are not yet shown.

    Args:
        spline: The motion.
        enclose: Upper bounds over ranges of position … jerk, rigorous if the caller's arithmetic is.
        limits: A piece is bisected while a bound is over its limit, `DEPTH` times at the most.

    Returns:
        One upper bound for each quantity; over the limit only where bisection could not bring it under.
    """
    peaks = [-math.inf] * len(limits)
    work = [(points, width, 0) for points, width in bezier_spans(spline)]
    while work:
        points, width, depth = work.pop()
        bounds = enclose(_ranges(points, width))
        if depth < DEPTH and any(bound > limit for bound, limit in zip(bounds, limits, strict=True)):
            left, right = _halves(points)
            work += [(left, width / 2, depth + 1), (right, width / 2, depth + 1)]
        else:
            peaks = [max(peak, bound) for peak, bound in zip(peaks, bounds, strict=True)]
    return peaks


def bezier_spans(spline: Spline) -> list[tuple[Array, float]]:
    """Bezier control points and the width of every span. Each shape (6,)."""
    from scipy.interpolate import insert

    tck: Any = (spline.knots, np.append(spline.coefficients, np.zeros(DEGREE + 1)), DEGREE)
    edges = np.unique(spline.knots)
    for knot in edges[1:-1]:
        tck = insert(knot, tck, m=DEGREE - 1)
    points = np.asarray(tck[1])
    return [(points[DEGREE * k : DEGREE * k + 6], float(w)) for k, w in enumerate(np.diff(edges))]


def _ranges(points: Array, width: float) -> list[tuple[float, float]]:
    """Ranges of position … jerk of one Bezier piece, from the control points of its derivatives."""
    result = []
    for order in range(4):
        result.append((float(points.min()), float(points.max())))
        points = (DEGREE - order) * np.diff(points) / width
    return result


def _halves(points: Array) -> tuple[Array, Array]:
    """De Casteljau's subdivision at the middle."""
    left, right = [points[0]], [points[-1]]
    while len(points) > 1:
        points = (points[:-1] + points[1:]) / 2
        left.append(points[0])
        right.append(points[-1])
    return np.array(left), np.array(right[::-1])
