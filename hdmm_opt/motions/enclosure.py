"""Bounds of a CasADi function along a motion, piece by piece, by interval arithmetic."""

from __future__ import annotations

from typing import Any

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from stability import Expression, enclose_many, from_casadi
from trajectories import Pieces
from trajectories.bezier import ORDERS
from trajectories.quantity import Enclosure

Array = NDArray[np.float64]

#: Boxes evaluated at once; bounds the memory.
BATCH = 4096


def enclosure(function: ca.Function) -> Enclosure:
    """Rigorous bounds of quantities on pieces of a motion.

    On each piece the natural interval evaluation and the mean value form in time,
    ``f(t) ∈ f(middle) + [-1, 1] width/2 · f'``, are intersected; the second one's excess falls with the square of the
    piece's width.

    Args:
        function: CasADi SX function (x, x', x'', x''') -> column, each input of shape (n,).

    Returns:
        The bounds as a function of pieces. The rounding of control points is in the ranges that pieces give. Where the
        rate holds an operation that cannot be bounded, such as the sign of an absolute value, the natural evaluation
        stands alone, and its excess falls with the width itself.

    Raises:
        NotImplementedError: the function holds an operation that the prover cannot bound.
        ValueError: the function's inputs differ in length.
    """
    count = function.numel_in(0)
    if any(function.numel_in(i) != count for i in range(function.n_in())) or function.n_in() != 4:
        raise ValueError(f"a quantity depends on x, x', x'', x''' of one shape: got {function}")
    names = tuple(f"x{order}_{k}" for order in range(ORDERS) for k in range(count))
    flat = ca.SX.sym("flat", len(names))
    curves = [flat[order * count : (order + 1) * count] for order in range(ORDERS)]
    value = function(*curves[:4])
    here = from_casadi(ca.Function("value", [flat], [ca.densify(value)]), names)
    rate = _slope(value, curves, flat, names)

    def bound(pieces: Pieces) -> tuple[Array, Array]:
        parts = [_bound(here, rate, names, pieces.chosen(part)) for part in _batches(len(pieces.start))]
        return np.concatenate([p[0] for p in parts], axis=1), np.concatenate([p[1] for p in parts], axis=1)

    return bound


def _batches(count: int) -> list[slice]:
    return [slice(first, first + BATCH) for first in range(0, count, BATCH)]


def _bound(here: Expression, rate: Expression | None, names: tuple[str, ...], pieces: Pieces) -> tuple[Array, Array]:
    # the whole piece and its middle in one evaluation
    ranges = pieces.ranges()
    ends = (np.concatenate(both, axis=2) for both in zip(ranges, pieces.middles(), strict=True))
    (low, point_low), (high, point_high) = (
        np.split(end, 2, axis=1) for end in enclose_many(here, _named(names, *ends))
    )
    if rate is None:
        return low, high
    slope = np.maximum(*(np.abs(end) for end in enclose_many(rate, _named(names, *ranges))))
    with np.errstate(invalid="ignore"):
        reach = np.nextafter(slope * np.nextafter(pieces.width / 2, np.inf), np.inf)
        below, above = np.nextafter(point_low - reach, -np.inf), np.nextafter(point_high + reach, np.inf)
    return np.fmax(low, below), np.fmin(high, above)


def _named(names: tuple[str, ...], low: Array, high: Array) -> dict[str, tuple[Array, Array]]:
    first, second = (end.reshape(len(names), -1) for end in (low, high))
    return {name: (first[i], second[i]) for i, name in enumerate(names)}


def _slope(value: Any, curves: list[Any], flat: Any, names: tuple[str, ...]) -> Expression | None:
    """The rate of a function along a motion; None where it holds an operation that cannot be bounded."""
    rate = sum((ca.jtimes(value, curves[m], curves[m + 1]) for m in range(4)), ca.SX.zeros(value.shape))
    try:
        return from_casadi(ca.Function("slope", [flat], [ca.densify(rate)]), names)
    except NotImplementedError:
        return None
