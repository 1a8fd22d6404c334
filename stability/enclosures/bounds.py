"""Rigorous ranges of expressions over boxes, to a stated width, by branch and bound."""

from __future__ import annotations

import heapq
from collections.abc import Mapping
from dataclasses import dataclass, replace

from .expression import Expression, enclose
from .interval import Interval


@dataclass(frozen=True, kw_only=True)
class Range:
    """An enclosure of the range of an expression.

    Attributes:
        interval: Holds every value over the box.
        reached: True where both ends are within the stated width of a value that the expression takes.
        boxes: Number of boxes that were evaluated.
    """

    interval: Interval
    reached: bool
    boxes: int


def range_of(
    expression: Expression, box: Mapping[str, Interval], *, width: float, output: int = 0, limit: int = 20_000
) -> Range:
    """Enclose the range of an output.

    Args:
        expression: The operations.
        box: The range of each input.
        width: How far each end may lie beyond a value that is taken.
        output: Which output.
        limit: Largest number of boxes for each end.

    Returns:
        The enclosure. It is rigorous whether or not the width was reached.

    Raises:
        ZeroDivisionError: a divisor can vanish in the box.
        ValueError: a square root of a negative number, or a width that is not positive.

    References:
        Moore, Kearfott and Cloud (2009), ch. 11: best first, the widest side halved.
    """
    if not width > 0:
        raise ValueError(f"the width of a bound must be positive: got {width:g}")
    one = replace(expression, outputs=(expression.outputs[output],))
    high, reached_high, boxes_high = _largest(one, dict(box), 1.0, width, limit)
    low, reached_low, boxes_low = _largest(one, dict(box), -1.0, width, limit)
    return Range(interval=Interval(-low, high), reached=reached_high and reached_low, boxes=boxes_high + boxes_low)


def _largest(
    expression: Expression, box: dict[str, Interval], sign: float, width: float, limit: int
) -> tuple[float, bool, int]:
    """An upper bound on sign · expression."""

    def upper(part: dict[str, Interval]) -> float:
        value = enclose(expression, part)[0]
        return value.high if sign > 0 else -value.low

    def taken(part: dict[str, Interval]) -> float:
        value = enclose(expression, {name: Interval(_middle(v)) for name, v in part.items()})[0]
        return value.low if sign > 0 else -value.high

    size = {name: (v.high - v.low) or 1.0 for name, v in box.items()}
    best, count = taken(box), 1
    queue = [(-upper(box), 0, box)]
    while count < limit:
        top, _, part = queue[0]
        if -top <= best + width:
            return -top, True, count
        heapq.heappop(queue)
        side = max(part, key=lambda name: (part[name].high - part[name].low) / size[name])
        middle = _middle(part[side])
        for half in (Interval(part[side].low, middle), Interval(middle, part[side].high)):
            child = {**part, side: half}
            best = max(best, taken(child))
            count += 1
            heapq.heappush(queue, (-upper(child), count, child))
    return -queue[0][0], False, count


def _middle(interval: Interval) -> float:
    return interval.low + (interval.high - interval.low) / 2
