"""Intervals on a fixed grid, rounded outwards: ranges and derivatives of large operation lists.

Theorem: as `arithmetic`; the same enclosures on whole numbers, an order of magnitude faster.
"""

from __future__ import annotations

import math
from fractions import Fraction
from typing import Any

from .arithmetic import WORK, Interval, tanh_point
from .forms import walk
from .limits import MAX_FIXED, SCALE, NotProvedError

Fixed = tuple[int, int]
#: A value and its derivatives by the name of the direction.
Slope = tuple[Fixed, dict[str, Fixed]]
UNIT: Fixed = (1 << SCALE, 1 << SCALE)
NONE: Fixed = (0, 0)
#: What a tanh costs, in products.
TANH_COST = 300
#: What a sine and a cosine of one number cost, in products.
TURN_COST = 27


def to_fixed(a: Interval) -> Fixed:
    """An interval of fractions, rounded outwards."""
    return (a[0].numerator << SCALE) // a[0].denominator, -((-a[1].numerator << SCALE) // a[1].denominator)


def from_fixed(a: Fixed) -> Interval:
    """The same interval in fractions."""
    return Fraction(a[0], 1 << SCALE), Fraction(a[1], 1 << SCALE)


def fixed_product(a: Fixed, b: Fixed) -> Fixed:
    """Product, rounded outwards."""
    WORK.one()
    (p, q), (r, s) = a, b
    if p >= 0:
        low, high = (p * r if r >= 0 else q * r), (q * s if s >= 0 else p * s)
    elif q <= 0:
        low, high = (p * s if s >= 0 else q * s), (q * r if r >= 0 else p * r)
    elif r >= 0:
        low, high = p * s, q * s
    elif s <= 0:
        low, high = q * r, p * r
    else:
        low, high = min(p * s, q * r), max(p * r, q * s)
    if max(low.bit_length(), high.bit_length()) > MAX_FIXED:
        raise NotProvedError("a bound leaves the range of numbers that the checker handles")
    return low >> SCALE, -(-high >> SCALE)


def fixed_inverse(a: Fixed) -> Fixed:
    """Reciprocal."""
    if a[0] <= 0 <= a[1]:
        raise NotProvedError("a divisor can vanish in the assumed box")
    WORK.one()
    one = 1 << 2 * SCALE
    return one // a[1], -(-one // a[0])


def fixed_square(a: Fixed) -> Fixed:
    """Range of x²."""
    low, high = sorted((abs(a[0]), abs(a[1])))
    return fixed_product((0 if a[0] <= 0 <= a[1] else low, high), (0 if a[0] <= 0 <= a[1] else low, high))


def fixed_root(a: Fixed) -> Fixed:
    """Range of the square root."""
    if a[0] < 0:
        raise NotProvedError("a square root of a negative number in the assumed box")
    WORK.one(2 + a[1].bit_length() // 16)
    return math.isqrt(a[0] << SCALE), math.isqrt(a[1] << SCALE) + 1


def fixed_turn(x: int) -> tuple[Fixed, Fixed]:
    """Enclosures of the sine and the cosine of one number: Taylor sums on |x| <= 1/2, doubling of the angle.

    Each of 28 terms is cut to the grid and moved by the cuts before it: within 2^-150 together; the rest of the series
    is below 2^-28 / 28! < 2^-125. Both, and what halving drops of the angle, are inside the room of 2^-88.
    """
    if abs(x) > 100 << SCALE:
        raise NotProvedError("an angle of the machine is beyond 100 rad")
    WORK.one(TURN_COST)
    doublings = 0
    while abs(x) > 1 << (SCALE - 1):
        x, doublings = x >> 1, doublings + 1
    term, sums = 1 << SCALE, [1 << SCALE, 0]
    for k in range(1, 28):
        term = (term * x >> SCALE) // k
        sums[k % 2] += -term if k % 4 > 1 else term
    room = 1 << (SCALE - 88)
    cosine, sine = ((v - room, v + room) for v in sums)
    for _ in range(doublings):
        sine, cosine = fixed_product((2 << SCALE, 2 << SCALE), fixed_product(sine, cosine)), fixed_square(sine)
        cosine = (1 << SCALE) - 2 * cosine[1], (1 << SCALE) - 2 * cosine[0]
    return sine, cosine


def fixed_sincos(a: Fixed) -> tuple[Fixed, Fixed]:
    """Ranges of sine and cosine.

    By value and slope at the middle with a curvature of at most 1; where the other one keeps its sign, by the ends.
    """
    one, middle = 1 << SCALE, (a[0] + a[1]) >> 1
    radius = max(a[1] - middle, middle - a[0])
    sine, cosine = fixed_turn(middle)
    bend = fixed_product((radius, radius), (radius, radius))[1] // 2 + 1

    def around(value: Fixed, slope: Fixed) -> Fixed:
        reach = fixed_product(slope, (-radius, radius))
        return max(-one, value[0] + reach[0] - bend), min(one, value[1] + reach[1] + bend)

    sines, cosines = around(sine, cosine), around(cosine, (-sine[1], -sine[0]))
    (first, last), keeps = (fixed_turn(a[0]), fixed_turn(a[1])), lambda b: not b[0] <= 0 <= b[1]
    if keeps(cosines):
        sines = max(sines[0], min(first[0][0], last[0][0])), min(sines[1], max(first[0][1], last[0][1]))
    if keeps(sines):
        cosines = max(cosines[0], min(first[1][0], last[1][0])), min(cosines[1], max(first[1][1], last[1][1]))
    return sines, cosines


def fixed_tanh(a: Fixed) -> Fixed:
    """Range of tanh."""
    WORK.one(TANH_COST)
    low, high = (tanh_point(Fraction(end, 1 << SCALE)) for end in a)
    return to_fixed((low[0], high[1]))


def slopes(program: dict[str, Any], ranges: dict[str, Interval], tangents: dict[str, dict[str, Interval]]) -> list[Any]:
    """Range of every output and its derivatives along named directions, over the ranges of the inputs.

    Args:
        program: Operation list.
        ranges: Range of each input.
        tangents: Derivatives of the inputs along each direction.

    Returns:
        A pair for each output, in fractions.
    """
    inputs = {name: to_fixed(value) for name, value in ranges.items()}
    moving = {name: {d: to_fixed(v) for d, v in along.items()} for name, along in tangents.items()}

    def const(value: Fraction) -> Slope:
        WORK.one(1 + value.denominator.bit_length() // 64)
        return to_fixed((value, value)), {}

    entries = walk(program, lambda name: (inputs[name], moving.get(name, {})), const, _slope)
    return [
        (from_fixed(value), {d: from_fixed(v) for d, v in along.items()})
        for value, along in (entries[index] for index in program["outputs"])
    ]


def _slope(operator: str, a: Slope, b: Slope | None = None) -> Slope:
    """One operation and its derivatives."""
    x, dx = a
    WORK.one(1 + len(dx) + (len(b[1]) if b is not None else 0))
    if b is not None:
        return _slope_of_two(operator, a, b)
    if operator == "neg":
        return (-x[1], -x[0]), {d: (-v[1], -v[0]) for d, v in dx.items()}
    if operator == "sq":
        return fixed_square(x), _scaled(dx, (2 * x[0], 2 * x[1]))
    if operator == "sqrt":
        value = fixed_root(x)
        return value, _scaled(dx, fixed_inverse((2 * value[0], 2 * value[1]))) if dx else {}
    if operator == "tanh":
        value, one = fixed_tanh(x), 1 << SCALE
        square = fixed_square(value)
        return value, _scaled(dx, (max(0, one - square[1]), min(one, one - square[0])))
    sine, cosine = fixed_sincos(x)
    return (sine, _scaled(dx, cosine)) if operator == "sin" else (cosine, _scaled(dx, (-sine[1], -sine[0])))


def _slope_of_two(operator: str, a: Slope, b: Slope) -> Slope:
    (x, dx), (y, dy) = a, b
    if operator == "add":
        return (x[0] + y[0], x[1] + y[1]), _together(dx, dy)
    if operator == "sub":
        return (x[0] - y[1], x[1] - y[0]), _together(dx, {d: (-v[1], -v[0]) for d, v in dy.items()})
    if operator == "mul":
        return fixed_product(x, y), _together(_scaled(dx, y), _scaled(dy, x))
    back = fixed_inverse(y)
    ratio = fixed_product(x, back)
    return ratio, _scaled(_together(dx, _scaled(dy, (-ratio[1], -ratio[0]))), back)


def _scaled(along: dict[str, Fixed], factor: Fixed) -> dict[str, Fixed]:
    return {d: fixed_product(v, factor) for d, v in along.items()}


def _together(first: dict[str, Fixed], second: dict[str, Fixed]) -> dict[str, Fixed]:
    if not second:
        return first
    found = dict(first)
    for d, v in second.items():
        old = found.get(d)
        found[d] = v if old is None else (old[0] + v[0], old[1] + v[1])
    return found
