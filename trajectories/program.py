"""The nonlinear program of a motion, with exact sparse derivatives.

Decision variables are the control points of every phase, its duration T, and in the relaxed program one slack for each
limit. Limits of the coordinates are rows on control points of derivatives, D_m c / T^m, so they hold for all t.
Quantities and running costs stand in `nodes.py`.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .limits import ORDERS
from .nodes import TIGHTENING, Nodes, casadi_matrix, spread_hessian, spread_jacobian
from .shape import Shape
from .spline import Spline, clamped_knots
from .task import Limit, Task

Array = NDArray[np.float64]


def derivative_matrices(spans: int, degree: int) -> list[Array]:
    """Maps from control points to the control points of position … jerk, on unit time."""
    knots = clamped_knots(0.0, 1.0, spans, degree)
    unit = Spline(knots=knots, coefficients=np.eye(len(knots) - degree - 1))
    return [unit.derivative_points(order)[1] for order in range(min(4, degree + 1))]


@dataclass(frozen=True, kw_only=True)
class Program:
    """A nonlinear program ready for a solver.

    Attributes:
        shape: Order of the variables.
        problem: Functions of the program by the names that CasADi's IPOPT interface gives them.
        lower: Lower bounds of the rows; those of the quantities come last, node by node.
        upper: Upper bounds of the rows.
        limits: What each slack of the relaxed program widens.
        nodes: Number of collocation points.
    """

    shape: Shape
    problem: dict[str, Any]
    lower: Array
    upper: Array
    limits: tuple[Limit, ...]
    nodes: int


def build(task: Task, scale: float, *, relaxed: bool = False) -> Program:
    """The program of a task.

    Args:
        task: The task.
        scale: Factor on the cost, so that it is about 1.
        relaxed: Whether the limits may be widened: then the cost is the sum of their slacks.
    """
    import casadi as ca

    limits = relaxable(task) if relaxed else ()
    shape = Shape(
        count=len(task.limits.names), controls=task.spans + task.degree, phases=task.phases, slacks=len(limits)
    )
    x = ca.SX.sym("x", shape.size)
    rows, low, high, cost = _smooth(task, shape, x, scale, relaxed)
    smooth = _derivatives(x, rows, cost)
    nodes = Nodes(task, shape, relaxed)
    problem = _assembled(shape.size, scale, smooth, nodes)
    return Program(
        shape=shape,
        problem=problem,
        lower=np.concatenate([low, np.tile(nodes.node.lower, nodes.count)]),
        upper=np.concatenate([high, np.tile(nodes.node.upper, nodes.count)]),
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


def _smooth(task: Task, shape: Shape, x: Any, scale: float, relaxed: bool) -> tuple[Any, Array, Array, Any]:
    """Rows on control points and durations, their bounds, and the cost of time or of the slacks."""
    import casadi as ca

    phases = [
        (ca.reshape(x[p * shape.block : shape.duration(p)], shape.count, shape.controls).T, x[shape.duration(p)])
        for p in range(shape.phases)
    ]
    maps = [ca.DM(ca.sparsify(ca.DM(m))) for m in derivative_matrices(task.spans, task.degree)]
    rows, low, high = [ca.SX.zeros(0, 1)], [np.zeros(0)], [np.zeros(0)]

    def add(row: Any, least: float, most: float) -> None:
        rows.append(row)
        low.append(np.full(row.numel(), least))
        high.append(np.full(row.numel(), most))

    slack = x[shape.phases * shape.block :]
    used = 0
    for order in ORDERS:
        for k, limit in enumerate(task.limits.of(order)):
            if not np.isfinite(limit):
                continue
            for points, duration in phases:
                row = maps[order] @ points[:, k] / (limit * (1 - TIGHTENING) * duration**order)
                if relaxed:
                    add(ca.vertcat(row, -row) - slack[used], -np.inf, 1.0)
                else:
                    add(row, -1.0, 1.0)
            used += 1
    for row in (*_ends(task, phases), *_junctions(task, phases, maps)):
        add(row, 0.0, 0.0)
    total = ca.sum1(ca.vertcat(*(duration for _, duration in phases)))
    if shape.phases > 1:
        add(total, *((task.duration,) * 2 if task.duration is not None else (0.0, task.longest)))
    return ca.vertcat(*rows), np.concatenate(low), np.concatenate(high), (
        ca.sum1(slack) + 1e-6 * total if relaxed else scale * task.cost.time * total
    )  # fmt: skip


def _ends(task: Task, phases: list[Any]) -> list[Any]:
    """Rest and place at the waypoints, as rows that vanish; what is given of coordinates stands in the bounds."""
    import casadi as ca

    rows = []
    for k, waypoint in enumerate(task.waypoints):
        points = phases[min(k, task.phases - 1)][0]
        at = points[0, :] if k < task.phases else points[-1, :]
        if waypoint.through is not None:
            value = ca.DM(np.asarray(waypoint.value, dtype=float))
            there = waypoint.through(at.T) - value
            rows += [there[i] for i in range(value.numel()) if np.isfinite(float(value[i]))]
    first, last = phases[0][0], phases[-1][0]
    for points, order, waypoint in ((first, 1, task.waypoints[0]), (last, -1, task.waypoints[-1])):
        at = 0 if order > 0 else points.shape[0] - 1
        for i in np.flatnonzero(np.isnan(waypoint.known)):
            rows += [points[at + order * j, int(i)] - points[at, int(i)] for j in range(1, task.rest)]
    return rows


def _junctions(task: Task, phases: list[Any], maps: list[Any]) -> list[Any]:
    """Equal position, speed and acceleration where phases meet."""
    rows = []
    for (before, t), (after, u) in pairwise(phases):
        for order in range(3):
            ends, starts = maps[order][-1, :] @ before, maps[order][0, :] @ after
            rows.append((ends * (u / t) ** order - starts).T if order else (ends - starts).T)
    return rows


def _derivatives(x: Any, rows: Any, cost: Any) -> dict[str, Any]:
    import casadi as ca

    factor, weight = ca.SX.sym("s"), ca.SX.sym("l", rows.numel())
    hessian = ca.triu(ca.hessian(factor * cost + ca.dot(weight, rows), x)[0])
    return {
        "value": ca.Function("smooth", [x], [cost, rows]),
        "gradient": ca.Function("smooth_gradient", [x], [ca.gradient(cost, x)]),
        "jacobian": ca.Function("smooth_jacobian", [x], [ca.jacobian(rows, x)]),
        "hessian": ca.Function("smooth_hessian", [x, factor, weight], [hessian]),
    }


def _assembled(size: int, scale: float, smooth: dict[str, Any], nodes: Nodes) -> dict[str, Any]:
    """The whole program's functions."""
    import casadi as ca

    x, factor = ca.MX.sym("x", size), ca.MX.sym("s")
    cost, rows = smooth["value"](x)
    gradient, jacobian = smooth["gradient"](x), smooth["jacobian"](x)
    weight = ca.MX.sym("l", rows.numel() + nodes.rows * nodes.count)
    hessian = smooth["hessian"](x, factor, weight[: rows.numel()])
    select = casadi_matrix(nodes.select)
    w = ca.reshape(select @ x, nodes.width, nodes.count)
    costs, limited = nodes.node.value.map(nodes.count)(w)
    shares = scale * ca.DM(nodes.weights).T
    cost += ca.dot(shares, costs)
    slopes = nodes.node.gradient.map(nodes.count)(w)
    gradient += select.T @ ca.vec(slopes * ca.repmat(shares, nodes.width, 1))
    jacobian = ca.vertcat(jacobian, spread_jacobian(nodes, w))
    given = ca.reshape(weight[rows.numel() :], nodes.rows, nodes.count)
    curved = nodes.node.hessian.map(nodes.count)(w, factor * shares, given)
    hessian += spread_hessian(nodes, curved)
    rows = ca.vertcat(rows, ca.vec(limited))
    p = ca.MX.sym("p", 0)
    return {
        "nlp": {"x": x, "p": p, "f": cost, "g": rows},
        "grad_f": ca.Function("nlp_grad_f", [x, p], [cost, gradient], ["x", "p"], ["f", "grad_f_x"]),
        "jac_g": ca.Function("nlp_jac_g", [x, p], [rows, jacobian], ["x", "p"], ["g", "jac_g_x"]),
        "hess_lag": ca.Function(
            "nlp_hess_l", [x, p, factor, weight], [hessian], ["x", "p", "lam_f", "lam_g"], ["triu_hess_gamma_x_x"]
        ),
    }
