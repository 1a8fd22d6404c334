"""Many boxes at once: enclosures of an expression over arrays of intervals, every operation rounded outwards."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .expression import Expression, run

Array = NDArray[np.float64]
Pair = tuple[Array, Array]

#: Beyond this size a float does not know its phase.
_FAR = 1e5
#: Units in the last place by which a result of the math library is widened: it is not correctly rounded.
_LIBRARY = 4


def enclose_many(expression: Expression, ranges: Mapping[str, Pair]) -> tuple[Array, Array]:
    """Enclosures of the outputs over many boxes, by natural interval evaluation.

    Args:
        expression: The operations.
        ranges: Lower and upper ends of each input, one entry for each box. Shapes (boxes,).

    Returns:
        Lower and upper ends. Each shape (outputs, boxes); infinite where a divisor may vanish, or the argument of a
        root may be negative.

    References:
        Moore, Kearfott and Cloud (2009), Introduction to Interval Analysis, ch. 2.
    """
    count = len(next(iter(ranges.values()))[0])
    with np.errstate(all="ignore"):
        table = run(expression, ranges.__getitem__, _OPERATORS, _constant)
    ends = [[np.broadcast_to(end, count) for end in table[index]] for index in expression.outputs]
    return np.stack([low for low, _ in ends]), np.stack([high for _, high in ends])


def tangents_many(
    expression: Expression, ranges: Mapping[str, Pair], directions: Mapping[str, Mapping[str, Pair]]
) -> list[dict[str, Pair]]:
    """Directional derivatives of the outputs over many boxes (forward differentiation).

    Args:
        expression: The operations.
        ranges: As for `enclose_many`.
        directions: For each input that moves, its rate of change along each named direction; arrays of shape (boxes,).

    Returns:
        For each output the enclosure of its derivative along each direction, over all of the box. What stands still
        is left out.

    Raises:
        NotImplementedError: the expression holds an operation that is not differentiated here.
    """

    def read(name: str) -> _Moving:
        return _Moving(ranges[name], dict(directions.get(name, {})))

    with np.errstate(all="ignore"):
        table = run(expression, read, _MOVING, lambda value: _Moving(_constant(value), {}))
    return [table[index].along for index in expression.outputs]


@dataclass(frozen=True)
class _Moving:
    """Values over many boxes, and their derivatives along some directions."""

    range: Pair
    along: dict[str, Pair]


def _combined(*parts: tuple[_Moving, Pair]) -> dict[str, Pair]:
    """The sum of tangents, each times a factor."""
    found: dict[str, Pair] = {}
    for moving, factor in parts:
        for name, value in moving.along.items():
            scaled = _mul(value, factor)
            found[name] = _add(found[name], scaled) if name in found else scaled
    return found


def _moving_quotient(a: _Moving, b: _Moving) -> _Moving:
    inverse = _div(_PLUS, b.range)
    ratio = _mul(a.range, inverse)
    return _Moving(ratio, _combined((a, inverse), (b, _neg(_mul(ratio, inverse)))))


def _moving_root(a: _Moving) -> _Moving:
    value = _sqrt(a.range)
    return _Moving(value, _combined((a, _div(_constant(0.5), value))))


def _constant(value: float) -> Pair:
    point = np.array(value)
    return point, point


def _outwards(low: Any, high: Any, steps: int = 1) -> Pair:
    for _ in range(steps):
        low, high = np.nextafter(low, -np.inf), np.nextafter(high, np.inf)
    return low, high


def _add(a: Pair, b: Pair) -> Pair:
    return _whole(a[0] + b[0], a[1] + b[1])


def _sub(a: Pair, b: Pair) -> Pair:
    return _whole(a[0] - b[1], a[1] - b[0])


def _mul(a: Pair, b: Pair) -> Pair:
    if b[0] is b[1] or a[0] is a[1]:  # a number
        first, second = a[0] * b[0], a[1] * b[1]
        low, high = np.minimum(first, second), np.maximum(first, second)
    else:
        first, second, third, fourth = a[0] * b[0], a[0] * b[1], a[1] * b[0], a[1] * b[1]
        low = np.minimum(np.minimum(first, second), np.minimum(third, fourth))
        high = np.maximum(np.maximum(first, second), np.maximum(third, fourth))
    if np.isnan(low).any():  # 0 times infinity: the member 0 makes it 0
        ends = [np.nan_to_num(x * y, nan=0.0, posinf=np.inf, neginf=-np.inf) for x in a for y in b]
        low, high = np.minimum.reduce(ends), np.maximum.reduce(ends)
    return _outwards(low, high)


def _div(a: Pair, b: Pair) -> Pair:
    inverse = _outwards(1.0 / b[1], 1.0 / b[0])
    low, high = _mul(a, inverse)
    holds = (b[0] <= 0.0) & (b[1] >= 0.0)
    return np.where(holds, -np.inf, low), np.where(holds, np.inf, high)


def _neg(a: Pair) -> Pair:
    return -a[1], -a[0]


def _square(a: Pair) -> Pair:
    small, large = _size(a)
    low, high = _outwards(small * small, large * large)
    return np.maximum(low, 0.0), high


def _size(a: Pair) -> Pair:
    """The range of the absolute value."""
    first, second = np.abs(a[0]), np.abs(a[1])
    return np.where((a[0] <= 0.0) & (a[1] >= 0.0), 0.0, np.minimum(first, second)), np.maximum(first, second)


def _sqrt(a: Pair) -> Pair:
    low, high = _outwards(np.sqrt(a[0]), np.sqrt(a[1]))
    below = ~(a[0] >= 0.0)
    return np.where(below, -np.inf, np.maximum(low, 0.0)), np.where(below, np.inf, high)


def _tanh(a: Pair) -> Pair:
    low, high = _outwards(np.tanh(a[0]), np.tanh(a[1]), _LIBRARY)
    return np.maximum(low, -1.0), np.minimum(high, 1.0)


def _exp(a: Pair) -> Pair:
    low, high = _outwards(np.minimum(np.exp(a[0]), 8e307), np.exp(a[1]), _LIBRARY)
    return np.maximum(low, 0.0), high


def _log(a: Pair) -> Pair:
    low, high = _outwards(np.log(a[0]), np.log(a[1]), _LIBRARY)
    wrong = ~(a[0] > 0.0)
    return np.where(wrong, -np.inf, low), np.where(wrong, np.inf, high)


def _asin(a: Pair) -> Pair:
    return _of_cosine(a, *_outwards(np.arcsin(a[0]), np.arcsin(a[1]), _LIBRARY))


def _acos(a: Pair) -> Pair:
    return _of_cosine(a, *_outwards(np.arccos(a[1]), np.arccos(a[0]), _LIBRARY))


def _of_cosine(a: Pair, low: Array, high: Array) -> Pair:
    wrong = ~((a[0] >= -1.0) & (a[1] <= 1.0))
    return np.where(wrong, -np.inf, low), np.where(wrong, np.inf, high)


def _atan(a: Pair) -> Pair:
    return _outwards(np.arctan(a[0]), np.arctan(a[1]), _LIBRARY)


def _atan2(a: Pair, b: Pair) -> Pair:
    """The whole circle where a box holds the origin or a point of the cut; else the angles of its corners."""
    corners = [np.arctan2(y, x) for y in a for x in b]
    low, high = _outwards(np.minimum.reduce(corners), np.maximum.reduce(corners), _LIBRARY)
    whole = ~((b[0] > 0.0) | (a[0] > 0.0) | (a[1] < 0.0))
    return np.where(whole, np.nextafter(-np.pi, -4.0), low), np.where(whole, np.nextafter(np.pi, 4.0), high)


def _sin(a: Pair) -> Pair:
    first, second = np.sin(a[0]), np.sin(a[1])
    low, high = _outwards(np.minimum(first, second), np.maximum(first, second), _LIBRARY)
    low = np.where(_passes(a, -math.pi / 2), -1.0, np.maximum(low, -1.0))
    high = np.where(_passes(a, math.pi / 2), 1.0, np.minimum(high, 1.0))
    far = ~((np.maximum(np.abs(a[0]), np.abs(a[1])) <= _FAR) & (a[1] - a[0] < 2 * math.pi))
    return np.where(far, -1.0, low), np.where(far, 1.0, high)


def _cos(a: Pair) -> Pair:
    quarter = math.pi / 2
    return _sin(_add(a, (np.array(math.nextafter(quarter, 0)), np.array(math.nextafter(quarter, 2)))))


def _passes(a: Pair, phase: float) -> Any:
    """Whether phase + 2πk may lie inside, with room for rounding."""
    room = 1e-9
    return np.ceil((a[0] - phase - room) / (2 * math.pi)) <= np.floor((a[1] - phase + room) / (2 * math.pi))


def _whole(low: Any, high: Any) -> Pair:
    """Rounded outwards; ends that cannot be told, ∞ - ∞, become infinite."""
    if np.isnan(low).any() or np.isnan(high).any():
        low, high = np.where(np.isnan(low), -np.inf, low), np.where(np.isnan(high), np.inf, high)
    return _outwards(low, high)


_OPERATORS: dict[str, Callable[..., Pair]] = {
    "add": _add,
    "sub": _sub,
    "mul": _mul,
    "div": _div,
    "neg": _neg,
    "sq": _square,
    "sqrt": _sqrt,
    "tanh": _tanh,
    "sin": _sin,
    "cos": _cos,
    "exp": _exp,
    "log": _log,
    "asin": _asin,
    "acos": _acos,
    "atan": _atan,
    "atan2": _atan2,
    "abs": _size,
    "min": lambda a, b: (np.minimum(a[0], b[0]), np.minimum(a[1], b[1])),
    "max": lambda a, b: (np.maximum(a[0], b[0]), np.maximum(a[1], b[1])),
}

_PLUS, _MINUS = _constant(1.0), _constant(-1.0)

_MOVING: dict[str, Callable[..., _Moving]] = {
    "add": lambda a, b: _Moving(_add(a.range, b.range), _combined((a, _PLUS), (b, _PLUS))),
    "sub": lambda a, b: _Moving(_sub(a.range, b.range), _combined((a, _PLUS), (b, _MINUS))),
    "mul": lambda a, b: _Moving(_mul(a.range, b.range), _combined((a, b.range), (b, a.range))),
    "div": _moving_quotient,
    "neg": lambda a: _Moving(_neg(a.range), _combined((a, _MINUS))),
    "sq": lambda a: _Moving(_square(a.range), _combined((a, _mul(_constant(2.0), a.range)))),
    "sqrt": _moving_root,
    "sin": lambda a: _Moving(_sin(a.range), _combined((a, _cos(a.range)))),
    "cos": lambda a: _Moving(_cos(a.range), _combined((a, _neg(_sin(a.range))))),
}
