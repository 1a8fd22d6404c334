"""Bounds of a CasADi function along a motion, piece by piece, by interval arithmetic."""

from __future__ import annotations

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from stability import Expression, enclose_many, from_casadi
from trajectories import Pieces
from trajectories.bezier import ROUNDING
from trajectories.quantity import Enclosure

Array = NDArray[np.float64]

#: Derivatives of the coordinates that a bound is made of: position … snap.
ORDERS = 5
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
        The bounds as a function of pieces. Rigorous up to the rounding of control points, for which every range is
        widened by 1e-12 of its size.

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
    slope = sum((ca.jtimes(value, curves[m], curves[m + 1]) for m in range(4)), ca.SX.zeros(value.shape))
    here = from_casadi(ca.Function("value", [flat], [ca.densify(value)]), names)
    rate = from_casadi(ca.Function("slope", [flat], [ca.densify(slope)]), names)

    def bound(pieces: Pieces) -> tuple[Array, Array]:
        parts = [_bound(here, rate, names, pieces.chosen(part)) for part in _batches(len(pieces.start))]
        return np.concatenate([p[0] for p in parts], axis=1), np.concatenate([p[1] for p in parts], axis=1)

    return bound


def _batches(count: int) -> list[slice]:
    return [slice(first, first + BATCH) for first in range(0, count, BATCH)]


def _bound(here: Expression, rate: Expression, names: tuple[str, ...], pieces: Pieces) -> tuple[Array, Array]:
    low, high = pieces.ranges(ORDERS)
    room = ROUNDING * np.maximum(np.abs(low), np.abs(high))
    middle, _ = _middle(pieces)
    # the whole piece and its middle in one evaluation
    ends = (np.concatenate(both, axis=2) for both in ((low, middle - room), (high, middle + room)))
    whole, point = zip(*(np.split(end, 2, axis=1) for end in enclose_many(here, _named(names, *ends))), strict=True)
    slope = np.maximum(*(np.abs(end) for end in enclose_many(rate, _named(names, low, high))))
    with np.errstate(invalid="ignore"):
        reach = np.nextafter(slope * np.nextafter(pieces.width / 2, np.inf), np.inf)
        below, above = np.nextafter(point[0] - reach, -np.inf), np.nextafter(point[1] + reach, np.inf)
    return np.fmax(whole[0], below), np.fmin(whole[1], above)


def _named(names: tuple[str, ...], low: Array, high: Array) -> dict[str, tuple[Array, Array]]:
    flat = (end.reshape(len(names), -1) for end in (low, high))
    return {name: ends for name, *ends in zip(names, *flat, strict=True)}  # type: ignore[misc]


def _middle(pieces: Pieces) -> tuple[Array, Array]:
    """Derivatives at the middle of each piece: the ends of its halves. Shape (orders, n, pieces)."""
    halves = pieces.halved()
    right = halves.chosen(slice(len(pieces.start), None))
    values, points, degree = [], right.points, right.points.shape[1] - 1
    for order in range(ORDERS):
        values.append(points[:, 0])
        points = (
            (degree - order) * np.diff(points, axis=1) / right.width[:, None, None] if order < degree else points * 0.0
        )
    return np.stack(values).swapaxes(1, 2), right.width
