"""The quickest moves from rest to rest inside limits on speed, acceleration and jerk alone, by Ruckig."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .limits import LimitViolatedError, MotionLimits, violations
from .spline import Spline

Array = NDArray[np.float64]

#: Knots closer than this share of the duration are one.
SAME = 1e-9
#: The limits are kept smaller by this share, because control points of the jerk are differences that round.
TIGHTENING = 1e-4


def jerk_limited(
    start: ArrayLike, goal: ArrayLike, limits: MotionLimits, begin: float = 0.0, *,
    speeds: tuple[ArrayLike | None, ArrayLike | None] = (None, None), acceleration: ArrayLike | None = None,
) -> Spline:  # fmt: skip
    """The quickest move of n coordinates that arrive together, jerk piecewise constant.

    Args:
        start: First position. Shape (n,).
        goal: Last position. Shape (n,).
        limits: Finite limits of speed, acceleration and jerk; a move of one coordinate from rest to rest stays between
            its ends.
        begin: First time, s.
        speeds: Speeds at the start and at the goal; None for rest. Shape (n,).
        acceleration: Acceleration at the start; None for none. Shape (n,).

    Returns:
        A spline of degree 3. Shape of its coefficients (k, n).

    Raises:
        ImportError: Ruckig is not installed; it is the extra "ruckig".
        ValueError: start and goal are the same, a limit is missing, or Ruckig finds no move.
        LimitViolatedError: phases so short that the jerk of the spline is lost in rounding.

    References:
        L. Berscheid and T. Kroeger (2021), Jerk-limited real-time trajectory generation with arbitrary target states,
        Robotics: Science and Systems.

    Not guaranteed: efforts, obstacles and paths are not considered; use `solve` for those.
    """
    first, last = (np.atleast_1d(np.asarray(p, dtype=float)) for p in (start, goal))
    rates = [np.zeros(len(first)) if v is None else np.asarray(v, dtype=float) for v in (*speeds, acceleration)]
    profiles, duration = _profiles(first, last, limits, rates)
    own = [np.concatenate([[0.0], np.cumsum(profile.t)]) for profile in profiles]
    times = np.unique(np.concatenate([*own, [0.0, duration]]))
    times = times[np.concatenate([[True], np.diff(times) > SAME * duration])]
    times[-1] = duration
    columns = [
        _cubic(times, edges, np.append(profile.j, 0.0), state)
        for edges, profile, *state in zip(own, profiles, first, rates[0], rates[2], strict=True)
    ]
    coefficients = np.stack(columns, axis=1)
    coefficients[-1 if rates[1].any() else -3 :] = last  # up to the rounding of the integration
    knots = begin + np.concatenate([np.zeros(3), times, np.full(3, duration)])
    spline = Spline(knots=knots, coefficients=coefficients)
    free = replace(limits, position=(-np.inf, np.inf))
    broken = violations(spline, free)
    if broken:
        raise LimitViolatedError(f"{broken[0]}: phases of the move are too short for its control points; use `solve`")
    return spline


def _profiles(start: Array, goal: Array, limits: MotionLimits, rates: list[Array]) -> tuple[list[Any], float]:
    try:
        import ruckig
    except ImportError as error:
        raise ImportError('jerk-limited moves need Ruckig: pip install "hdmm-opt[ruckig]"') from error

    sizes = [limits.of(order) * (1 - TIGHTENING) for order in (1, 2, 3)]
    if not np.abs(goal - start).max() > 0 and not any(rate.any() for rate in rates):
        raise ValueError(f"a move needs two places: got {start.tolist()} twice")
    if not all(np.isfinite(size).all() and (size > 0).all() for size in sizes):
        raise ValueError("a jerk-limited move needs finite positive limits of speed, acceleration and jerk: got others")
    given = ruckig.InputParameter(len(start))
    given.current_position, given.target_position = start.tolist(), goal.tolist()
    given.current_velocity, given.target_velocity, given.current_acceleration = (rate.tolist() for rate in rates)
    given.max_velocity, given.max_acceleration, given.max_jerk = (size.tolist() for size in sizes)
    trajectory = ruckig.Trajectory(len(start))
    result = ruckig.Ruckig(len(start)).calculate(given, trajectory)
    if result not in (ruckig.Result.Working, ruckig.Result.Finished):
        raise ValueError(f"Ruckig found no move from {start.tolist()} to {goal.tolist()}: it says {result.name}")
    return trajectory.profiles[0], float(trajectory.duration)


def _cubic(times: Array, edges: Array, jerks: Array, start: Sequence[float]) -> Array:
    """Control points of the cubic spline with a given piecewise constant jerk, from position, speed, acceleration."""
    middle = (times[:-1] + times[1:]) / 2
    jerk = jerks[np.clip(np.searchsorted(edges, middle, side="right") - 1, 0, len(jerks) - 1)]
    states = [np.array(start)]
    for width, j in zip(np.diff(times), jerk, strict=True):
        p, v, a = states[-1]
        states.append(np.array([
            p + v * width + a * width**2 / 2 + j * width**3 / 6, v + a * width + j * width**2 / 2, a + j * width,
        ]))  # fmt: skip
    knots = np.concatenate([times[[0] * 3], times, times[[-1] * 3]])
    points = []
    for i in range(len(times) + 2):
        piece = min(max(i - 1, 0), len(jerk) - 1)
        u = knots[i + 1 : i + 4] - times[piece]
        pairs = (u[0] * u[1] + u[0] * u[2] + u[1] * u[2]) / 3
        p, v, a = states[piece]
        points.append(p + v * u.mean() + a / 2 * pairs + jerk[piece] / 6 * u.prod())
    return np.array(points)
