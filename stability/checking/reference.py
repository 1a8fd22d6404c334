"""Bounds of a reference for all t from its control points.

Theorem: a spline lies in the hull of its control points (de Boor 1978). Must fail: jumps, a moving end, other
bounds.
"""

from __future__ import annotations

from fractions import Fraction
from itertools import pairwise
from typing import Any

from .arithmetic import Interval
from .limits import MAX_BITS, MAX_COEFFICIENTS, need
from .parsing import number, numbers


def reference_bounds(reference: dict[str, Any]) -> list[Interval]:
    """Position … jerk of the splines, from their control points; refuses jumps and a moving end."""
    hulls: list[list[Fraction]] = [[], [], [], []]
    previous: list[Fraction] | None = None
    clock = Fraction(0)
    need(isinstance(reference["segments"], list) and len(reference["segments"]) > 0, "the reference has no segment")
    for segment in reference["segments"]:
        count = len(segment["coefficients"])
        need(segment["degree"] == 5 and 6 <= count <= MAX_COEFFICIENTS, "a segment is a spline of degree 5")
        knots = numbers(segment["knots"], count + 6, "knots")
        points = numbers(segment["coefficients"], count, "coefficients")
        need(max(v.denominator.bit_length() for v in (*knots, *points)) <= MAX_BITS, "a spline's number is too long")
        need(knots[0] == knots[5] and knots[-1] == knots[-6], "a segment's knots must be clamped")
        need(knots == sorted(knots), "knots must not decrease")
        need(all(a < b for a, b in pairwise(knots[5 : count + 1])), "inner knots must increase")
        need(knots[0] == clock, "the segments must follow each other in time, from 0 on")
        clock = knots[-1]
        ends: list[tuple[Fraction, Fraction]] = []
        for order in range(4):
            hulls[order] += points
            ends.append((points[0], points[-1]))
            degree = 5 - order
            points = [
                degree * (b - a) / (knots[j + degree + 1] - knots[j + 1]) for j, (a, b) in enumerate(pairwise(points))
            ]
            knots = knots[1:-1]
        need(previous is None or previous == [e[0] for e in ends[:3]], "the reference jumps between segments")
        previous = [e[1] for e in ends[:3]]
    need(previous is not None and previous[1] == previous[2] == 0, "the reference must end at rest")
    for hull, stated in zip(hulls, reference["derivative_bounds"], strict=True):
        room = Fraction(1, 10**8) * max(map(abs, hull))
        low, high = number(stated["lower"], "a bound") - room, number(stated["upper"], "a bound") + room
        close = low <= min(hull) <= low + 2 * room and high - 2 * room <= max(hull) <= high
        need(close, "the stated derivative bounds are not those of the splines")
    at_rest = [[], *([Fraction(0)] for _ in range(3))]
    return [(min(h + zero), max(h + zero)) for h, zero in zip(hulls, at_rest, strict=True)]
