"""A spline piece by piece: Bezier control points, whose hull holds the piece and each of its derivatives."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .spline import Spline

Array = NDArray[np.float64]

#: Room for the rounding of control points, relative to the largest of them.
ROUNDING = 1e-12


@dataclass(frozen=True, kw_only=True)
class Pieces:
    """Polynomial pieces of a motion.

    Attributes:
        points: Bezier control points. Shape (pieces, degree + 1, n).
        start: First time of each piece, s. Shape (pieces,).
        width: Duration of each piece, s. Shape (pieces,).
    """

    points: Array
    start: Array
    width: Array

    def chosen(self, mask: Any) -> Pieces:
        """Some of the pieces, by a mask or a slice."""
        return Pieces(points=self.points[mask], start=self.start[mask], width=self.width[mask])

    def halved(self) -> Pieces:
        """Every piece cut in the middle (de Casteljau): all left halves, then all right halves."""
        left, right, points = [self.points[:, 0]], [self.points[:, -1]], self.points
        while points.shape[1] > 1:
            points = (points[:, :-1] + points[:, 1:]) / 2
            left.append(points[:, 0])
            right.append(points[:, -1])
        half = self.width / 2
        return Pieces(
            points=np.concatenate([np.stack(left, axis=1), np.stack(right[::-1], axis=1)]),
            start=np.concatenate([self.start, self.start + half]),
            width=np.concatenate([half, half]),
        )

    def ranges(self, orders: int) -> tuple[Array, Array]:
        """Lower and upper bounds of the derivatives 0 … orders - 1 on each piece. Each shape (orders, n, pieces)."""
        low, high = [], []
        points, degree = self.points, self.points.shape[1] - 1
        for order in range(orders):
            room = ROUNDING * np.abs(points).max(axis=1)
            low.append(points.min(axis=1) - room)
            high.append(points.max(axis=1) + room)
            if order < degree:
                points = (degree - order) * np.diff(points, axis=1) / self.width[:, None, None]
            else:
                points = np.zeros_like(points)
        return np.stack(low).swapaxes(1, 2), np.stack(high).swapaxes(1, 2)


def pieces(spline: Spline) -> Pieces:
    """The pieces between the knots, by knot insertion (Boehm 1980)."""
    degree = spline.degree
    knots, points = spline.knots, spline.coefficients.reshape(len(spline.coefficients), -1)
    edges, counts = np.unique(knots, return_counts=True)
    for knot, count in zip(edges[1:-1], counts[1:-1], strict=True):
        for _ in range(degree - count):
            knots, points = _inserted(knots, points, knot, degree)
    index = degree * np.arange(len(edges) - 1)[:, None] + np.arange(degree + 1)
    return Pieces(points=points[index], start=edges[:-1], width=np.diff(edges))


def _inserted(knots: Array, points: Array, knot: float, degree: int) -> tuple[Array, Array]:
    span = int(np.searchsorted(knots, knot, side="right")) - 1
    index = np.arange(span - degree + 1, span + 1)
    share = ((knot - knots[index]) / (knots[index + degree] - knots[index]))[:, None]
    mixed = share * points[index] + (1 - share) * points[index - 1]
    return np.insert(knots, span + 1, knot), np.concatenate([points[: index[0]], mixed, points[index[-1] :]])
