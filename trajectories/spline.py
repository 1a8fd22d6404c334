"""Clamped B-splines of degree 5 and bounds on them that hold for all t."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

Array = NDArray[np.float64]

DEGREE = 5


@dataclass(frozen=True, kw_only=True)
class Spline:
    """A scalar spline of degree 5.

    Attributes:
        knots: Clamped knot vector in s, six equal knots at each end. Shape (k + 6,).
        coefficients: Control points. Shape (k,).
    """

    knots: Array
    coefficients: Array

    @property
    def start(self) -> float:
        """First time, s."""
        return float(self.knots[0])

    @property
    def end(self) -> float:
        """Last time, s."""
        return float(self.knots[-1])

    def derivative_points(self, order: int) -> tuple[Array, Array]:
        """Knots and control points of a derivative.

        The derivative lies in the convex hull of these points for all t (de Boor 1978, ch. X).
        """
        knots, points = self.knots, self.coefficients
        for degree in range(DEGREE, DEGREE - order, -1):
            points = degree * np.diff(points) / (knots[degree + 1 : -1] - knots[1 : -degree - 1])
            knots = knots[1:-1]
        return knots, points

    def bounds(self, order: int) -> tuple[float, float]:
        """Lower and upper bound on a derivative for all t, by control points (float arithmetic)."""
        points = self.derivative_points(order)[1]
        return float(points.min()), float(points.max())

    def __call__(self, t: ArrayLike, order: int = 0) -> Array:
        """Values of a derivative; constant outside the knots."""
        from scipy.interpolate import BSpline

        knots, points = self.derivative_points(order)
        inside = np.clip(np.asarray(t, dtype=float), self.start, self.end)
        return np.asarray(BSpline(knots, points, DEGREE - order)(inside))


def clamped_knots(start: float, end: float, spans: int) -> Array:
    """Uniform clamped knots of degree 5. Shape (spans + 11,)."""
    inner = np.linspace(start, end, spans + 1)
    return np.concatenate([np.full(DEGREE, start), inner, np.full(DEGREE, end)])


def constant(value: float, start: float, end: float) -> Spline:
    """A dwell."""
    knots = clamped_knots(start, end, 1)
    return Spline(knots=knots, coefficients=np.full(len(knots) - DEGREE - 1, value))
