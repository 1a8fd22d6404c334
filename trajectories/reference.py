"""A reference: splines joined at rest, with the derivative bounds that a proof uses."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .spline import Spline

Array = NDArray[np.float64]


@dataclass(frozen=True, kw_only=True)
class Reference:
    """Position as a function of time.

    Attributes:
        segments: Splines that follow each other in time and join with equal position, speed and acceleration. The
            last one ends at rest; the reference stays there.

    Raises:
        ValueError: segments that do not join.
    """

    segments: tuple[Spline, ...]

    def __post_init__(self) -> None:
        for before, after in zip(self.segments, self.segments[1:], strict=False):
            ends = [before.derivative_points(k)[1][-1] for k in range(3)]
            starts = [after.derivative_points(k)[1][0] for k in range(3)]
            if ends != starts or before.end != after.start:
                raise ValueError(f"segments must join in position, speed and acceleration: got {ends} and {starts}")

    @property
    def duration(self) -> float:
        """Time of the last knot, s."""
        return self.segments[-1].end

    def bounds(self) -> tuple[tuple[float, float], ...]:
        """Bounds on position, speed, acceleration and jerk for all t, by control points. Shape (4, 2)."""
        per_segment = [[segment.bounds(order) for segment in self.segments] for order in range(4)]
        return tuple((min(low for low, _ in row), max(high for _, high in row)) for row in per_segment)

    def __call__(self, t: ArrayLike) -> Array:
        """Position, speed, acceleration and jerk. Shape (4, len(t))."""
        times = np.atleast_1d(np.asarray(t, dtype=float))
        edges = np.array([segment.start for segment in self.segments[1:]])
        which = np.searchsorted(edges, times, side="right")
        values = np.zeros((4, times.size))
        for index, segment in enumerate(self.segments):
            chosen = which == index
            if chosen.any():
                values[:, chosen] = [segment(times[chosen], order) for order in range(4)]
        values[1:, times >= self.duration] = 0.0
        return values
