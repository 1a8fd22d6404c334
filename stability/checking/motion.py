"""The motion of all members over slices of time.

Obligation: motion. Must fail: knots that differ, more slices than a file of ours.
"""

from __future__ import annotations

from collections.abc import Iterable
from fractions import Fraction
from itertools import pairwise
from typing import Any

from .arithmetic import Interval
from .limits import MAX_SLICES, need
from .parsing import index, number
from .reference import ranges_on


def cut(a: Interval, count: int) -> list[Interval]:
    """Parts of an interval that cover it."""
    ends = [a[0] + (a[1] - a[0]) * Fraction(k, count) for k in range(count + 1)]
    return list(pairwise(ends))


def slices(together: list[Any], halvings: Any) -> Iterable[list[list[Interval]]]:
    """Ranges of position … jerk of every member over slices of time: pieces between knots, each halved some times."""
    parts = 2 ** index(halvings, 9, "halvings")
    need(len({len(segments) for segments in together}) == 1, "the references of the members have different segments")
    count = sum(
        parts if len(segment["coefficients"]) > 6 else 1
        for segment in together[0] for a, b in pairwise(segment["knots"]) if a < b
    )  # fmt: skip
    need(count <= MAX_SLICES, f"the motion is cut into {count} slices, more than {MAX_SLICES}")
    for segments in zip(*together, strict=True):
        knots = [number(k, "a knot") for k in segments[0]["knots"]]
        for segment in segments[1:]:
            need(segment["knots"] == segments[0]["knots"], "the references of the members have different knots")
        points = [[number(c, "a coefficient") for c in segment["coefficients"]] for segment in segments]
        for span in range(5, len(knots) - 6):
            low, high = knots[span], knots[span + 1]
            if low == high:
                continue
            pieces = 1 if len(points[0]) == 6 else parts
            for k in range(pieces):
                ends = low + (high - low) * Fraction(k, pieces), low + (high - low) * Fraction(k + 1, pieces)
                yield [ranges_on(knots, own, span, ends) for own in points]
