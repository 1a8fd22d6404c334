"""Clamped B-splines and bounds on them that hold for all t."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

Array = NDArray[np.float64]

#: The usual degree: jerk is continuous, and its control points bound it closely.
DEGREE = 5


@dataclass(frozen=True, kw_only=True)
class Spline:
    """A spline of one or several coordinates.

    Attributes:
        knots: Clamped knot vector in s, degree + 1 equal knots at each end. Shape (k + degree + 1,).
        coefficients: Control points of one coordinate, shape (k,), or of n coordinates, shape (k, n).
    """

    knots: Array
    coefficients: Array

    @property
    def degree(self) -> int:
        """Degree of the pieces."""
        return len(self.knots) - len(self.coefficients) - 1

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
        for degree in range(self.degree, self.degree - order, -1):
            width = (knots[degree + 1 : -1] - knots[1 : -degree - 1]).reshape(-1, *[1] * (points.ndim - 1))
            points = degree * np.diff(points, axis=0) / width
            knots = knots[1:-1]
        return knots, points

    def bounds(self, order: int) -> tuple[Any, Any]:
        """Lower and upper bound on a derivative for all t, by control points (float arithmetic).

        Two numbers for one coordinate, two arrays of shape (n,) for several.
        """
        points = self.derivative_points(order)[1]
        low, high = points.min(axis=0), points.max(axis=0)
        return (float(low), float(high)) if points.ndim == 1 else (low, high)

    def __call__(self, t: ArrayLike, order: int = 0) -> Array:
        """Values of a derivative, shape (len(t),) or (len(t), n); constant outside the knots."""
        from scipy.interpolate import BSpline

        knots, points = self.derivative_points(order)
        inside = np.clip(np.asarray(t, dtype=float), self.start, self.end)
        return np.asarray(BSpline(knots, points, self.degree - order)(inside))

    def curves(self, t: ArrayLike) -> list[Array]:
        """Position … jerk, zero above the degree. Each shape (len(t), n)."""
        known = [self(t, order).reshape(np.size(t), -1) for order in range(min(4, self.degree + 1))]
        return known + [np.zeros_like(known[0])] * (4 - len(known))

    def coordinate(self, index: int) -> Spline:
        """One coordinate of several."""
        return Spline(knots=self.knots, coefficients=self.coefficients[:, index])


def clamped_knots(start: float, end: float, spans: int, degree: int = DEGREE) -> Array:
    """Uniform clamped knots. Shape (spans + 2 degree + 1,)."""
    inner = np.linspace(start, end, spans + 1)
    return np.concatenate([np.full(degree, start), inner, np.full(degree, end)])


def constant(value: float, start: float, end: float) -> Spline:
    """A dwell."""
    knots = clamped_knots(start, end, 1)
    return Spline(knots=knots, coefficients=np.full(len(knots) - DEGREE - 1, value))


def fitted(times: Array, values: Array, knots: Array, degree: int = DEGREE) -> Spline:
    """Least-squares spline through samples of n coordinates. Shapes (m,) and (m, n)."""
    from scipy.interpolate import make_lsq_spline

    return Spline(knots=knots, coefficients=np.asarray(make_lsq_spline(times, values, knots, degree).c))


def joined(first: Spline, second: Spline) -> Spline:
    """One spline of two that follow each other and agree in position, speed and acceleration.

    The junction becomes a knot of multiplicity degree - 2, so the result has exactly these three derivatives
    continuous; the one control point that belongs to both is the mean of what each side says, so two splines that
    agree to rounding give a spline that differs from them by rounding.

    Args:
        first: Ends where `second` starts; same degree (3 or more) and number of coordinates.
        second: The continuation.

    Raises:
        ValueError: they do not follow each other, or differ in degree.
    """
    degree, at = first.degree, first.end
    if second.degree != degree or second.start != at or degree < 3:
        raise ValueError(
            f"splines of one degree, 3 or more, that follow each other can be joined: got degrees {degree} and "
            f"{second.degree}, an end at {at:g} s and a start at {second.start:g} s"
        )
    left, right = first.coefficients, second.coefficients
    before, two_before = first.knots[-degree - 2], first.knots[-degree - 3]
    after, two_after = second.knots[degree + 1], second.knots[degree + 2]
    # the blossom at (before, J, .., J, c) is affine in c on the left, that at (J, .., J, after, c) on the right
    from_left = left[-2] + (after - at) / (at - two_before) * (left[-2] - left[-3])
    from_right = right[1] + (before - at) / (two_after - at) * (right[2] - right[1])
    middle = (from_left + from_right) / 2
    return Spline(
        knots=np.concatenate([first.knots[: -degree - 1], np.full(degree - 2, at), second.knots[degree + 1 :]]),
        coefficients=np.concatenate([left[:-2], middle[None], right[2:]]),
    )
