"""Rest-to-rest quintic moves as splines."""

from __future__ import annotations

from itertools import combinations
from math import comb, prod

import numpy as np
from numpy.typing import NDArray

from .spline import DEGREE, Spline, clamped_knots

Array = NDArray[np.float64]

#: Spans of the spline that carries a quintic; the control points then bound its acceleration within 1 %.
SPANS = 24

#: s(t) = 10 t³ - 15 t⁴ + 6 t⁵ by power of t, and the largest |s'|, |s''|, |s'''| on [0, 1].
_POWERS = {3: 10.0, 4: -15.0, 5: 6.0}
PEAKS = (1.875, 10 / 3**0.5, 60.0)


def quintic(start: float, goal: float, begin: float, duration: float) -> Spline:
    """The polynomial of degree 5 from rest to rest.

    Args:
        start: First position, m.
        goal: Last position, m.
        begin: First time, s.
        duration: Time of the move, s, > 0.

    Returns:
        The same polynomial on `SPANS` spans; control points by blossoming (Ramshaw 1989).

    Raises:
        ValueError: a duration that is not positive.
    """
    if not duration > 0:
        raise ValueError(f"a move needs a positive duration: got {duration}")
    knots = clamped_knots(0.0, 1.0, SPANS)
    unit = np.array([_blossom(tuple(knots[i + 1 : i + 1 + DEGREE])) for i in range(len(knots) - DEGREE - 1)])
    unit[:3], unit[-3:] = 0.0, 1.0
    coefficients = start + (goal - start) * unit
    coefficients[-3:] = goal
    times = begin + duration * knots
    return Spline(knots=times, coefficients=coefficients)


def law(share: Array) -> Array:
    """Share of the way at a share of the time. Any shape."""
    return 10 * share**3 - 15 * share**4 + 6 * share**5


def _blossom(arguments: tuple[float, ...]) -> float:
    """The symmetric multi-affine form of the polynomial."""
    return sum(
        factor * sum(prod(chosen) for chosen in combinations(arguments, power)) / comb(DEGREE, power)
        for power, factor in _POWERS.items()
    )


def shortest_duration(distance: float, speed: float, acceleration: float, jerk: float) -> float:
    """The shortest quintic move inside limits on speed, acceleration and jerk, s."""
    size = abs(distance)
    return max(PEAKS[0] * size / speed, (PEAKS[1] * size / acceleration) ** 0.5, (PEAKS[2] * size / jerk) ** (1 / 3))
