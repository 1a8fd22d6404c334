"""Bounds of a reference for all t from its control points.

Theorem: a spline lies in the hull of its control points (de Boor 1978), a piece of it in that of its Bezier points,
found by blossoms (Ramshaw 1989). Must fail: jumps, a moving end, other
bounds.
"""

from __future__ import annotations

from fractions import Fraction
from itertools import pairwise
from typing import Any

from .arithmetic import WORK, Interval, down, up
from .limits import MAX_COEFFICIENTS, need
from .parsing import number, numbers

#: What a piece of a spline costs, in products.
PIECE_COST = 200


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


def ranges_on(
    knots: list[Fraction], points: list[Fraction], span: int, ends: tuple[Fraction, Fraction]
) -> list[Interval]:
    """Hulls of the Bezier points of position … jerk of a spline on a part of a span, by blossoms (Ramshaw 1989)."""
    WORK.one(PIECE_COST)
    degree = 5
    curve = [
        blossom(knots, points, span, [ends[0]] * (degree - k) + [ends[1]] * k) for k in range(degree + 1)
    ]  # fmt: skip
    found = []
    for order in range(4):
        found.append((down(min(curve)), up(max(curve))))
        curve = [(degree - order) * (b - a) / (ends[1] - ends[0]) for a, b in pairwise(curve)]
    return found


def blossom(knots: list[Fraction], points: list[Fraction], span: int, arguments: list[Fraction]) -> Fraction:
    """The symmetric multi-affine form of a spline's piece."""
    degree = len(arguments)
    values = points[span - degree : span + 1]
    for level, t in enumerate(arguments):
        following = []
        for j in range(degree - level):
            first = knots[span - degree + level + 1 + j]
            last = knots[span + 1 + j]
            share = (t - first) / (last - first)
            following.append(values[j] + share * (values[j + 1] - values[j]))
        values = following
    return values[0]
