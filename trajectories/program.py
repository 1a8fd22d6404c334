"""The nonlinear program of a motion, with exact sparse derivatives.

Decision variables are the control points of every phase, its duration T, and in the relaxed program one slack for each
limit. Limits of the coordinates are rows on control points of derivatives, D_m c / T^m, so they hold for all t.
Quantities and running costs stand in `nodes.py`.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property, lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .limits import ORDERS
from .nodes import TIGHTENING, Nodes, casadi_matrix, spread_hessian, spread_jacobian
from .passing import pattern, row_values, rows
from .shape import Shape
from .spline import Spline, clamped_knots
from .task import Limit, Task

Array = NDArray[np.float64]

#: Programs that are kept for the next task that differs in places, speeds and times alone.
KEPT = 8
#: Quantities keep so many times the reserve at an end that the program chooses.
END = 2.0


def derivative_matrices(spans: int, degree: int) -> list[Array]:
    """Maps from control points to the control points of position … jerk, on unit time."""
    knots = clamped_knots(0.0, 1.0, spans, degree)
    unit = Spline(knots=knots, coefficients=np.eye(len(knots) - degree - 1))
    return [unit.derivative_points(order)[1] for order in range(min(4, degree + 1))]


@dataclass(frozen=True, kw_only=True, eq=False)
class Program:
    """A nonlinear program ready for a solver. Its parameter is a factor on the cost.

    Attributes:
        shape: Order of the variables.
        problem: Functions of the program by the names that CasADi's IPOPT interface gives them.
        lower: Lower bounds of the rows without those of waypoints and durations; those of the quantities come last,
            node by node.
        upper: Upper bounds of the same rows.
        given: How many rows stand before those of waypoints and durations.
        limits: What each slack of the relaxed program widens.
        nodes: Number of collocation points.
    """

    shape: Shape
    problem: dict[str, Any]
    lower: Array
    upper: Array
    given: int
    limits: tuple[Limit, ...]
    nodes: int

    def rows(self, task: Task) -> tuple[Array, Array]:
        """Bounds of all rows for a task of this program."""
        low, high = row_values(task)
        if task.phases > 1:
            ends = (0.0, task.longest) if task.duration is None else (task.duration,) * 2
            low, high = np.append(low, ends[0]), np.append(high, ends[1])
        lower, upper = self.lower.copy(), self.upper.copy()
        if np.isnan(task.waypoints[-1].known).any() and not task.waypoints[-1].moving:
            # where the goal leaves room, another motion can start from there
            last = (len(lower) - self.given) // self.nodes
            lower[len(lower) - last :] += END * TIGHTENING
            upper[len(upper) - last :] -= END * TIGHTENING
        return (
            np.concatenate([lower[: self.given], low, lower[self.given :]]),
            np.concatenate([upper[: self.given], high, upper[self.given :]]),
        )


@dataclass(frozen=True, eq=False)
class _Form:
    """A task as far as its program depends on it: not on places, speeds and times."""

    task: Task
    relaxed: bool

    @cached_property
    def key(self) -> tuple[Any, ...]:
        """Equal for tasks of one program."""
        task, given, cost = self.task, self.task.quantities, self.task.cost
        return (
            self.relaxed, task.phases, task.spans, task.degree, task.rest, pattern(task), task.limits.names,
            task.limits.units, *(tuple(task.limits.of(order)) for order in ORDERS),
            given and (given.function, given.names, given.units, tuple(given.lower), tuple(given.upper)),
            (cost.time, cost.jerk, cost.running, cost.weights),
        )  # fmt: skip

    def __eq__(self, other: object) -> bool:
        return isinstance(other, _Form) and self.key == other.key

    def __hash__(self) -> int:
        return hash(self.key)


def build(task: Task, *, relaxed: bool = False) -> Program:
    """The program of a task; tasks that differ in places, speeds and times alone share it.

    Args:
        task: The task.
        relaxed: Whether the limits may be widened: then the cost is the sum of their slacks.
    """
    return _built(_Form(task, relaxed))


@lru_cache(maxsize=KEPT)
def _built(form: _Form) -> Program:
    import casadi as ca

    task, relaxed = form.task, form.relaxed
    limits = relaxable(task) if relaxed else ()
    shape = Shape(
        count=len(task.limits.names), controls=task.spans + task.degree, phases=task.phases, slacks=len(limits)
    )
    x, scale = ca.SX.sym("x", shape.size), ca.SX.sym("p")
    limited, given, cost = _smooth(task, shape, x, scale, relaxed)
    smooth = _derivatives(x, scale, ca.vertcat(limited, given), cost)
    nodes = Nodes(task, shape, relaxed)
    problem = _assembled(shape.size, smooth, nodes)
    count = limited.numel()
    return Program(
        shape=shape,
        problem=problem,
        lower=np.concatenate([np.full(count, -np.inf if relaxed else -1.0), np.tile(nodes.node.lower, nodes.count)]),
        upper=np.concatenate([np.ones(count), np.tile(nodes.node.upper, nodes.count)]),
        given=count,
        limits=limits,
        nodes=nodes.count,
    )


def relaxable(task: Task) -> tuple[Limit, ...]:
    """The limits that a relaxation may widen: of derivatives, then of quantities."""
    found = [
        Limit(
            name=task.limits.title(order, k),
            unit=task.limits.unit(order, k),
            value=float(value),
            scale=float(value),
            side=0,
            order=order,
            index=k,
        )
        for order in ORDERS
        for k, value in enumerate(task.limits.of(order))
        if np.isfinite(value)
    ]
    given = task.quantities
    if given is not None:
        for ends, side in ((given.upper, 1), (given.lower, -1)):
            found += [
                Limit(
                    name=given.names[i],
                    unit=given.units[i],
                    value=float(end),
                    scale=float(given.scale[i]),
                    side=side,
                    order=0,
                    index=i,
                )
                for i, end in enumerate(ends)
                if np.isfinite(end)
            ]
    return tuple(found)


def _smooth(task: Task, shape: Shape, x: Any, scale: Any, relaxed: bool) -> tuple[Any, Any, Any]:
    """Rows of the limits on control points, rows of waypoints and durations, and the cost of time or of the slacks."""
    import casadi as ca

    phases = [
        (ca.reshape(x[p * shape.block : shape.duration(p)], shape.count, shape.controls).T, x[shape.duration(p)])
        for p in range(shape.phases)
    ]
    maps = [ca.DM(ca.sparsify(ca.DM(m))) for m in derivative_matrices(task.spans, task.degree)]
    limited = [ca.SX.zeros(0, 1)]
    slack = x[shape.phases * shape.block :]
    used = 0
    for order in ORDERS:
        for k, limit in enumerate(task.limits.of(order)):
            if not np.isfinite(limit):
                continue
            for points, duration in phases:
                row = maps[order] @ points[:, k] / (limit * (1 - TIGHTENING) * duration**order)
                limited.append(ca.vertcat(row, -row) - slack[used] if relaxed else row)
            used += 1
    total = ca.sum1(ca.vertcat(*(duration for _, duration in phases)))
    given = [*rows(task, phases, maps), *([total] if shape.phases > 1 else [])]
    cost = ca.sum1(slack) + 1e-6 * total if relaxed else scale * task.cost.time * total
    return ca.vertcat(*limited), ca.vertcat(ca.SX.zeros(0, 1), *given), cost


def _derivatives(x: Any, scale: Any, rows: Any, cost: Any) -> dict[str, Any]:
    import casadi as ca

    factor, weight = ca.SX.sym("s"), ca.SX.sym("l", rows.numel())
    hessian = ca.triu(ca.hessian(factor * cost + ca.dot(weight, rows), x)[0])
    return {
        "value": ca.Function("smooth", [x, scale], [cost, rows]),
        "gradient": ca.Function("smooth_gradient", [x, scale], [ca.gradient(cost, x)]),
        "jacobian": ca.Function("smooth_jacobian", [x], [ca.jacobian(rows, x)]),
        "hessian": ca.Function("smooth_hessian", [x, factor, weight], [hessian]),
    }


def _assembled(size: int, smooth: dict[str, Any], nodes: Nodes) -> dict[str, Any]:
    """The whole program's functions."""
    import casadi as ca

    x, p, factor = ca.MX.sym("x", size), ca.MX.sym("p"), ca.MX.sym("s")
    cost, rows = smooth["value"](x, p)
    gradient, jacobian = smooth["gradient"](x, p), smooth["jacobian"](x)
    weight = ca.MX.sym("l", rows.numel() + nodes.rows * nodes.count)
    hessian = smooth["hessian"](x, factor, weight[: rows.numel()])
    select = casadi_matrix(nodes.select)
    w = ca.reshape(select @ x, nodes.width, nodes.count)
    costs, limited = nodes.node.value.map(nodes.count)(w)
    shares = p * ca.DM(nodes.weights).T
    cost += ca.dot(shares, costs)
    slopes = nodes.node.gradient.map(nodes.count)(w)
    gradient += select.T @ ca.vec(slopes * ca.repmat(shares, nodes.width, 1))
    jacobian = ca.vertcat(jacobian, spread_jacobian(nodes, w))
    given = ca.reshape(weight[rows.numel() :], nodes.rows, nodes.count)
    curved = nodes.node.hessian.map(nodes.count)(w, factor * shares, given)
    hessian += spread_hessian(nodes, curved)
    rows = ca.vertcat(rows, ca.vec(limited))
    return {
        "nlp": {"x": x, "p": p, "f": cost, "g": rows},
        "grad_f": ca.Function("nlp_grad_f", [x, p], [cost, gradient], ["x", "p"], ["f", "grad_f_x"]),
        "jac_g": ca.Function("nlp_jac_g", [x, p], [rows, jacobian], ["x", "p"], ["g", "jac_g_x"]),
        "hess_lag": ca.Function(
            "nlp_hess_l", [x, p, factor, weight], [hessian], ["x", "p", "lam_f", "lam_g"], ["triu_hess_gamma_x_x"]
        ),
    }
