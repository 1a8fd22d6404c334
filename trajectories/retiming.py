"""The quickest motion along a given path by TOPP-RA, checked again for all t after composition."""

from __future__ import annotations

import logging
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .guess import Guess, fitted_controls, unit_times
from .limits import LimitViolatedError, MotionLimits
from .path import Path, along
from .quantity import Enclosure, Peaks, Quantities, peaks
from .spline import Spline
from .task import Task

Array = NDArray[np.float64]

#: Grid points on the path.
GRID = 400
#: Share of the limits below which no further retiming is tried.
LEAST_SHARE = 0.2
#: TOPP-RA is told of a quantity that is affine in s'² and s'' up to this share of its size, at so many places.
AFFINE, TRIED = 0.01, 9
#: Retimings at the most, each inside tighter limits, until the composed motion is inside the given ones.
ROUNDS = 6


@dataclass(frozen=True, kw_only=True)
class Retimed:
    """A motion along a path.

    Attributes:
        law: Path coordinate over time: s' is continuous, s'' piecewise constant, so jerk is not limited.
        peaks: Bounds for all t of speeds, accelerations and quantities; all inside their limits.
        quantities: What `peaks` bounds.
        share: The smaller of the shares of the limits that were left to TOPP-RA, of the coordinates and of the
            quantities that it is told of, so that everything is inside for all t.
    """

    law: Spline
    peaks: Peaks
    quantities: Quantities
    share: float

    @property
    def duration(self) -> float:
        """Duration, s."""
        return self.law.end - self.law.start


def retime(
    path: Path, limits: MotionLimits, enclose: Callable[[Any], Enclosure], quantities: Quantities | None = None, *,
    grid: int = GRID,
) -> Retimed:  # fmt: skip
    """The quickest motion along a path inside limits on speed, acceleration and quantities such as torques.

    Args:
        path: The curve.
        limits: Limits of speed and acceleration; jerk is left free.
        enclose: Makes the bounds of a function on pieces of a motion.
        quantities: Quantities of position, speed and acceleration. Those that are affine in x'' and in products of
            speeds, such as joint torques, are given to TOPP-RA; the others are in the check afterwards alone.
        grid: Number of intervals on the path.

    Returns:
        The motion, which is inside every limit for all t.

    Raises:
        LimitViolatedError: the path cannot be followed; the message says where it ends being controllable, and what
            is outside its limit there at rest.
        ValueError: a quantity depends on jerk, which TOPP-RA leaves free.

    References:
        H. Pham and Q.-C. Pham (2018), A new approach to time-optimal path parameterization based on reachability
        analysis, IEEE Transactions on Robotics 34, 645-659.

    Not guaranteed: TOPP-RA is optimal on its grid; between grid points s'' is constant. Positions are those of the path
    and are not checked against `limits`.
    """
    free = replace(limits, jerk=np.inf)
    checked = along(path, free, quantities, enclose)
    affine = np.zeros(0, dtype=bool) if quantities is None else _affine(path, free, quantities)
    told = np.concatenate([np.zeros(len(checked.names) - len(affine), dtype=bool), affine])
    shares = np.ones(2)  # of the limits of the coordinates, and of those of the quantities that TOPP-RA is told
    for _ in range(ROUNDS):
        law = _law(path, free, quantities, affine, grid, shares)
        found = peaks(law, checked)
        if found.inside:
            return Retimed(law=law, peaks=found, quantities=checked, share=float(shares.min()))
        excess = (found.excess / checked.scale[:, None]).max(axis=1, initial=0.0)
        worst = np.array([excess[~told].max(initial=0.0), excess[told].max(initial=0.0)])
        shares *= 1.0 - np.where(worst > 0, 1.1 * worst + 1e-6, 0.0)
        if not shares.min() > LEAST_SHARE:
            break
    worst = int((found.excess.max(axis=1) / checked.scale).argmax())
    raise LimitViolatedError(
        f"{checked.names[worst]} stays outside its limit on the retimed path, by {found.excess[worst].max():.3g} "
        f"{checked.units[worst]}; use more than {grid} intervals, leave out what is not affine in x'' and products of "
        "speeds, or solve a `path_task`"
    )


def guess_of(retimed: Retimed, path: Path, task: Task, room: float = 1.02) -> Guess:
    """Where the search for a motion of n coordinates may start: the path, run through as retimed.

    Args:
        retimed: The motion along the path.
        path: The path.
        task: A task of one phase from the start of the path to its end.
        room: Factor on the duration.
    """
    return _sampled(task, path(retimed.law(_times(retimed, task))), room * retimed.duration)


def law_guess(retimed: Retimed, task: Task, room: float = 1.02) -> Guess:
    """The same for a task of the path coordinate, such as one with limited jerk."""
    return _sampled(task, retimed.law(_times(retimed, task))[:, None], room * retimed.duration)


def _times(retimed: Retimed, task: Task) -> Array:
    return retimed.law.start + retimed.duration * unit_times(task)


def _sampled(task: Task, values: Array, duration: float) -> Guess:
    points = fitted_controls(task, values)
    for end, own in ((slice(0, task.rest), values[0]), (slice(-task.rest, None), values[-1])):
        points[end] = np.clip(own, *task.limits.room)
    return Guess(points=(points,), durations=np.array([duration]))


def _law(
    path: Path, limits: MotionLimits, quantities: Quantities | None, affine: NDArray[np.bool_], grid: int, shares: Array
) -> Spline:
    """Path coordinate over time, within shares of the limits."""
    import toppra
    from toppra.algorithm import TOPPRA

    logging.getLogger("toppra").setLevel(logging.ERROR)
    points = np.linspace(0.0, 1.0, grid + 1)
    algorithm = TOPPRA(
        _constraints(toppra.constraint, limits, quantities, affine, shares), _curve(path, points), gridpoints=points,
        solver_wrapper="seidel", parametrizer="ParametrizeConstAccel",
    )  # fmt: skip
    algorithm.compute_parameterization(0.0, 0.0)
    rates = algorithm.problem_data.sd_vec
    if rates is None or np.isnan(rates).any():
        raise LimitViolatedError(_uncontrollable(algorithm, path, quantities, points))
    return _quadratic(points, np.asarray(rates))


def _quadratic(points: Array, rates: Array) -> Spline:
    """The quadratic spline through grid points with given rates: s'' is constant between them."""
    times = np.concatenate([[0.0], np.cumsum(2 * np.diff(points) / (rates[:-1] + rates[1:]))])
    knots = np.concatenate([times[[0, 0]], times, times[[-1, -1]]])
    inner = points[:-1] + rates[:-1] * np.diff(times) / 2
    return Spline(knots=knots, coefficients=np.concatenate([points[:1], inner, points[-1:]]))


def _affine(path: Path, limits: MotionLimits, quantities: Quantities) -> NDArray[np.bool_]:
    """Which quantities are affine in s'² and s'' along the path. Shape (q,)."""
    kept = np.ones(len(quantities.names), dtype=bool)
    for s in np.linspace(0.0, 1.0, TRIED):
        place, slope, bend = (path([s], order)[0] for order in range(3))
        rate = float((limits.of(1) / np.maximum(np.abs(slope), 1e-12)).min())
        gain = min(float((limits.of(2) / np.maximum(np.abs(slope), 1e-12)).min()), rate**2)

        def value(v: float, a: float) -> Array:
            curves = (place, slope * v, bend * v**2 + slope * a, np.zeros_like(place))  # noqa: B023
            return np.array(quantities.function(*curves)).ravel()

        still, fast = value(0.0, 0.0), value(rate, 0.0)
        off = value(rate / 2, 0.0) - still - (fast - still) / 4
        bent = value(rate, gain / 2) - fast - (value(rate, gain) - fast) / 2
        kept &= np.maximum(np.abs(off), np.abs(bent)) <= AFFINE * quantities.scale
    return kept


def _constraints(
    constraint: Any, limits: MotionLimits, quantities: Quantities | None, affine: NDArray[np.bool_], shares: Array
) -> list[Any]:
    scheme = constraint.DiscretizationType.Interpolation
    found = []
    for kind, order in (("JointVelocityConstraint", 1), ("JointAccelerationConstraint", 2)):
        size = np.minimum(shares[0] * limits.of(order), 1e6)
        own = getattr(constraint, kind)(np.stack([-size, size], axis=1))
        if order == 2:
            own.set_discretization_type(scheme)
        found.append(own)
    if quantities is not None and affine.any():
        inwards = (1.0 - shares[1]) * quantities.scale
        lower, upper = quantities.lower + inwards, quantities.upper - inwards
        above, below = (np.flatnonzero(np.isfinite(ends) & affine) for ends in (upper, lower))
        count = len(quantities.names)
        factors = np.concatenate([np.eye(count)[above], -np.eye(count)[below]])
        limit = np.concatenate([upper[above], -lower[below]])

        def torque(q: Array, v: Array, a: Array) -> Array:
            return np.array(quantities.function(q, v, a, np.zeros_like(q))).ravel()

        own = constraint.SecondOrderConstraint(torque, lambda _: factors, lambda _: limit, len(limits.names))
        own.set_discretization_type(scheme)
        found.append(own)
    return found


def _curve(path: Path, points: Array) -> Any:
    """The path in the form that toppra takes."""
    from toppra.interpolator import AbstractGeometricPath

    class Curve(AbstractGeometricPath):
        dof = property(lambda _: path(points[:1]).shape[1])
        path_interval = property(lambda _: np.array([0.0, 1.0]))
        waypoints = property(lambda _: None)

        def __call__(self, path_positions: Any, order: int = 0) -> Array:
            values = path(path_positions, order)
            return values if np.ndim(path_positions) else values[0]

    return Curve()


def _uncontrollable(algorithm: Any, path: Path, quantities: Quantities | None, points: Array) -> str:
    """Where the path ends being controllable, and what is outside its limit there at rest."""
    sets = algorithm.compute_controllable_sets(0.0, 0.0)
    lost = np.flatnonzero(np.isnan(sets).any(axis=1))
    at = float(points[lost[-1]]) if len(lost) else 0.0
    message = f"the path cannot be followed inside the limits: no speed is left at {100 * at:.0f} % of it"
    if quantities is None:
        return message + "; raise the limits of acceleration there"
    still = np.zeros(path(np.array([at])).shape[1])
    for s in (at, *points):
        values = np.array(quantities.function(path([s])[0], still, still, still)).ravel()
        outside = np.maximum(values - quantities.upper, quantities.lower - values) / quantities.scale
        worst = int(outside.argmax())
        if outside[worst] > 0:
            name, unit, value = quantities.names[worst], quantities.units[worst], values[worst]
            limit = quantities.upper[worst] if value > quantities.upper[worst] else quantities.lower[worst]
            return (
                f"{message}; at rest at {100 * s:.0f} % of it {name} is {value:.5g} {unit}, its limit "
                f"{limit:.5g} {unit}: move the path, or widen that limit"
            )
    return message + "; widen the limits of acceleration or of the quantities there"
