"""A spline piece by piece: Bezier control points, whose hull holds the piece and each of its derivatives."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .spline import Spline

Array = NDArray[np.float64]

#: Derivatives that pieces carry: position … snap.
ORDERS = 5
#: Units of rounding that making and halving control points may cost.
_UNITS = 64 * np.finfo(float).eps


@dataclass(frozen=True, kw_only=True)
class Pieces:
    """Polynomial pieces of a motion and of its derivatives.

    Attributes:
        curves: Bezier control points of position … snap. Shapes (pieces, points, n).
        room: Bound on the rounding of the control points of each. Shape (5, n).
        start: First time of each piece, s. Shape (pieces,).
        width: Duration of each piece, s. Shape (pieces,).
    """

    curves: tuple[Array, ...]
    room: Array
    start: Array
    width: Array

    def chosen(self, mask: Any) -> Pieces:
        """Some of the pieces, by a mask or a slice."""
        curves = tuple(curve[mask] for curve in self.curves)
        return Pieces(curves=curves, room=self.room, start=self.start[mask], width=self.width[mask])

    def halved(self) -> Pieces:
        """Every piece cut in the middle: all left halves, then all right halves."""
        half = self.width / 2
        return Pieces(
            curves=tuple(np.concatenate(_halves(curve)) for curve in self.curves),
            room=self.room,
            start=np.concatenate([self.start, self.start + half]),
            width=np.concatenate([half, half]),
        )

    def ranges(self) -> tuple[Array, Array]:
        """Lower and upper bounds of position … snap on each piece. Each shape (5, n, pieces)."""
        low = np.stack([curve.min(axis=1) for curve in self.curves]).swapaxes(1, 2)
        high = np.stack([curve.max(axis=1) for curve in self.curves]).swapaxes(1, 2)
        return low - self.room[:, :, None], high + self.room[:, :, None]

    def middles(self) -> tuple[Array, Array]:
        """The same at the middle of each piece alone."""
        points = np.stack([_halves(curve)[1][:, 0] for curve in self.curves]).swapaxes(1, 2)
        return points - self.room[:, :, None], points + self.room[:, :, None]


def pieces(spline: Spline) -> Pieces:
    """The pieces between the knots, by knot insertion (Boehm 1980)."""
    degree = spline.degree
    knots, points = spline.knots, spline.coefficients.reshape(len(spline.coefficients), -1)
    edges, counts = np.unique(knots, return_counts=True)
    for knot, count in zip(edges[1:-1], counts[1:-1], strict=True):
        for _ in range(degree - count):
            knots, points = _inserted(knots, points, knot, degree)
    index = degree * np.arange(len(edges) - 1)[:, None] + np.arange(degree + 1)
    width = np.diff(edges)
    curves, rooms = [points[index]], [_UNITS * np.abs(points).max(axis=0)]
    for order in range(1, ORDERS):
        left = degree + 1 - order
        if left < 1:
            curves.append(np.zeros_like(curves[0][:, :1]))
            rooms.append(np.zeros_like(rooms[0]))
            continue
        curves.append(left * np.diff(curves[-1], axis=1) / width[:, None, None])
        # the error of a difference of two control points, each with its own, over the narrowest piece
        rooms.append(2 * left * rooms[-1] / width.min() + _UNITS * np.abs(curves[-1]).max(axis=(0, 1)))
    return Pieces(curves=tuple(curves), room=np.stack(rooms), start=edges[:-1], width=width)


def _halves(points: Array) -> tuple[Array, Array]:
    """Control points of the left and the right half (de Casteljau)."""
    left, right = [points[:, 0]], [points[:, -1]]
    while points.shape[1] > 1:
        points = (points[:, :-1] + points[:, 1:]) / 2
        left.append(points[:, 0])
        right.append(points[:, -1])
    return np.stack(left, axis=1), np.stack(right[::-1], axis=1)


def _inserted(knots: Array, points: Array, knot: float, degree: int) -> tuple[Array, Array]:
    span = int(np.searchsorted(knots, knot, side="right")) - 1
    index = np.arange(span - degree + 1, span + 1)
    share = ((knot - knots[index]) / (knots[index + degree] - knots[index]))[:, None]
    mixed = share * points[index] + (1 - share) * points[index - 1]
    return np.insert(knots, span + 1, knot), np.concatenate([points[: index[0]], mixed, points[index[-1] :]])
