"""Curves in joint space, and motion along them: limits of n coordinates as quantities of the one path coordinate."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from math import comb
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .limits import ORDERS, MotionLimits
from .quantity import Enclosure, Quantities
from .task import Cost, Task, Waypoint

Array = NDArray[np.float64]


@dataclass(frozen=True, kw_only=True)
class Path:
    """A curve r(s), 0 ≤ s ≤ 1.

    Attributes:
        function: CasADi SX function s -> r, shape (n,), three times differentiable.
    """

    function: Any

    @cached_property
    def derivatives(self) -> Any:
        """CasADi function s -> (r, r', r'', r''')."""
        import casadi as ca

        s = ca.SX.sym("s")
        found = [self.function(s)]
        for _ in range(3):
            found.append(ca.jacobian(found[-1], s))
        return ca.Function("path", [s], [ca.densify(f) for f in found])

    def __call__(self, s: ArrayLike, order: int = 0) -> Array:
        """Values of a derivative. Shape (len(s), n)."""
        points = np.atleast_1d(np.asarray(s, dtype=float))
        return np.array(self.derivatives.map(len(points))(points[None, :])[order]).T


def bezier(points: ArrayLike) -> Path:
    """A polynomial curve by its Bezier control points, shape (degree + 1, n); two of them are a straight line."""
    import casadi as ca

    given = np.atleast_2d(np.asarray(points, dtype=float))
    degree = len(given) - 1
    if degree < 1 or not np.isfinite(given).all():
        raise ValueError(f"a curve needs two or more finite control points: got {given.tolist()}")
    s = ca.SX.sym("s")
    if degree == 1:
        value = ca.DM(given[0]) + s * ca.DM(given[1] - given[0])
    else:
        value = sum(
            comb(degree, i) * s**i * (1 - s) ** (degree - i) * ca.DM(given[i]) for i in range(degree + 1)
        )  # fmt: skip
    return Path(function=ca.Function("curve", [s], [value]))


def composed(path: Path, curves: list[Any]) -> list[Any]:
    """Position … jerk along a path from those of the path coordinate (the chain rule)."""
    r, r1, r2, r3 = path.derivatives(curves[0])
    _, ds, dds, ddds = curves
    return [r, r1 * ds, r2 * ds**2 + r1 * dds, r3 * ds**3 + 3 * r2 * ds * dds + r1 * ddds]


def along(
    path: Path, limits: MotionLimits, quantities: Quantities | None, enclose: Callable[[Any], Enclosure]
) -> Quantities:
    """Limits of the coordinates and of quantities as those of the path coordinate.

    Args:
        path: The curve.
        limits: Limits of the n coordinates; position is not limited along the path, check its ends and shape.
        quantities: Quantities of the n coordinates.
        enclose: Makes the bounds of a function on pieces of a motion.

    Returns:
        Every finite limit on speed, acceleration and jerk of a coordinate, and the quantities.
    """
    import casadi as ca

    curves = [ca.SX.sym(name) for name in ("s", "ds", "dds", "ddds")]
    motion = composed(path, curves)
    rows, names, units, sizes = [], [], [], []
    for order in ORDERS:
        for k, limit in enumerate(limits.of(order)):
            if np.isfinite(limit):
                rows.append(motion[order][k])
                names.append(limits.title(order, k))
                units.append(limits.unit(order, k))
                sizes.append((-limit, limit))
    if quantities is not None:
        rows.append(quantities.function(*motion))
        names += quantities.names
        units += quantities.units
        sizes += zip(quantities.lower, quantities.upper, strict=True)
    if not rows:
        raise ValueError("motion along a path needs a finite limit or a quantity: got none; it would take no time")
    function = ca.Function("along", curves, [ca.densify(ca.vertcat(*rows))])
    lower, upper = np.array(sizes).T
    return Quantities(
        function=function, names=tuple(names), units=tuple(units), lower=lower, upper=upper, enclose=enclose(function)
    )


def path_task(quantities: Quantities, cost: Cost | None = None, **options: Any) -> Task:
    """The motion from the start of a path to its end, inside quantities made by `along`.

    Args:
        quantities: Of the path coordinate.
        cost: Of the path coordinate; its duration by default.
        options: Further entries of `Task`.
    """
    return Task(
        waypoints=(Waypoint(value=np.zeros(1)), Waypoint(value=np.ones(1))),
        limits=MotionLimits(position=(0.0, 1.0), names=("path coordinate",), units=("1",)),
        quantities=quantities,
        cost=cost or Cost(),
        **options,
    )
