"""The nonlinear program of a motion, with exact sparse derivatives.

Decision variables are the control points of every phase, its duration T, and in the relaxed program one slack for each
limit. Limits of the coordinates are rows on control points of derivatives, D_m c / T^m, so they hold for all t.
Quantities and running costs are evaluated at Gauss points of every span as functions of w = (x, x', x'', x''' per unit
time, T), and w is a constant sparse matrix times the variables: their derivatives are those of one small function,
spread by sparse matrices that are made once.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .limits import ORDERS
from .quantity import sizes
from .spline import Spline, clamped_knots
from .task import Limit, Task

Array = NDArray[np.float64]

#: Collocation points in each span.
POINTS = 3
#: Every limit is kept smaller by this share in the program, so that what the solver's tolerance leaves is inside.
TIGHTENING = 1e-4
#: Least duration of a phase as a share of the first guess.
SHORTEST = 0.02


def derivative_matrices(spans: int, degree: int, orders: int = 4) -> list[Array]:
    """Maps from control points to the control points of the derivatives 0 … orders - 1, on unit time."""
    knots = clamped_knots(0.0, 1.0, spans, degree)
    unit = Spline(knots=knots, coefficients=np.eye(len(knots) - degree - 1))
    return [unit.derivative_points(order)[1] for order in range(min(orders, degree + 1))]


def gauss(spans: int) -> tuple[Array, Array]:
    """Gauss-Legendre points and weights of every span, on unit time."""
    local, weight = np.polynomial.legendre.leggauss(POINTS)
    starts = np.arange(spans)[:, None]
    return ((starts + (local + 1) / 2) / spans).ravel(), np.tile(weight / (2 * spans), spans)


def collocation_points(spans: int) -> tuple[Array, Array]:
    """Gauss points and weights, and both ends of the phase with weight 0: a motion rests there, and must be able to."""
    points, weights = gauss(spans)
    return np.concatenate([[0.0], points, [1.0]]), np.concatenate([[0.0], weights, [0.0]])


@dataclass(frozen=True, kw_only=True)
class Shape:
    """Where things stand in the vector of variables: phase by phase its control points and its duration, then slacks.

    Attributes:
        count: Coordinates n.
        controls: Control points k of a phase.
        phases: Phases.
        slacks: Slacks.
    """

    count: int
    controls: int
    phases: int
    slacks: int = 0

    @property
    def block(self) -> int:
        """Variables of a phase."""
        return self.controls * self.count + 1

    @property
    def size(self) -> int:
        """Variables in all."""
        return self.phases * self.block + self.slacks

    def place(self, phase: int, control: Any, coordinate: Any) -> Any:
        """Index of a coordinate of a control point."""
        return phase * self.block + control * self.count + coordinate

    def duration(self, phase: int) -> int:
        """Index of a phase's duration."""
        return (phase + 1) * self.block - 1

    def packed(self, points: list[Array], durations: Array) -> Array:
        """The vector of variables of control points, each shape (k, n), and durations; slacks 0."""
        parts = [np.append(p.ravel(), t) for p, t in zip(points, durations, strict=True)]
        return np.concatenate([*parts, np.zeros(self.slacks)])

    def unpacked(self, x: Array) -> tuple[list[Array], Array]:
        """Control points and durations of the phases."""
        blocks = x[: self.phases * self.block].reshape(self.phases, self.block)
        return [block[:-1].reshape(self.controls, self.count) for block in blocks], blocks[:, -1]


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
        scale: Factor on the cost.
    """

    shape: Shape
    problem: dict[str, Any]
    lower: Array
    upper: Array
    limits: tuple[Limit, ...]
    nodes: int
    scale: float


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
    nodes = _Nodes(task, shape, relaxed)
    problem = _assembled(shape.size, scale, smooth, nodes)
    return Program(
        shape=shape,
        problem=problem,
        lower=np.concatenate([low, np.tile(nodes.node.lower, nodes.count)]),
        upper=np.concatenate([high, np.tile(nodes.node.upper, nodes.count)]),
        limits=limits,
        nodes=nodes.count,
        scale=scale,
    )


def relaxable(task: Task) -> tuple[Limit, ...]:
    """The limits that a relaxation may widen: of derivatives, then of quantities."""
    found = [
        Limit(name=task.limits.title(order, k), unit=task.limits.unit(order, k), value=value, scale=value, side=0)
        for order in ORDERS
        for k, value in enumerate(task.limits.of(order))
        if np.isfinite(value)
    ]
    given = task.quantities
    if given is not None:
        for ends, side in ((given.upper, 1), (given.lower, -1)):
            found += [
                Limit(name=given.names[i], unit=given.units[i], value=end, scale=given.scale[i], side=side)
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
        add(total, *((task.duration,) * 2 if task.duration else (0.0, task.longest)))
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
        "gradient": ca.Function("smooth_gradient", [x], [cost, ca.gradient(cost, x)]),
        "jacobian": ca.Function("smooth_jacobian", [x], [rows, ca.jacobian(rows, x)]),
        "hessian": ca.Function("smooth_hessian", [x, factor, weight], [hessian]),
    }


@dataclass(frozen=True, kw_only=True)
class _Node:
    """Quantities and running costs at one collocation point as functions of w, with derivatives.

    Attributes:
        value: w -> cost rate times duration, limited rows.
        gradient: w -> gradient of the first.
        jacobian: w -> Jacobian of the second.
        hessian: (w, factor, weights) -> Hessian of their weighted sum.
        lower: Lower bounds of the rows.
        upper: Upper bounds of the rows.
    """

    value: Any
    gradient: Any
    jacobian: Any
    hessian: Any
    lower: Array
    upper: Array


class _Nodes:
    """The collocation points of a task."""

    def __init__(self, task: Task, shape: Shape, relaxed: bool) -> None:
        local, weights = collocation_points(task.spans)
        self.count = len(local) * shape.phases
        self.weights = np.tile(weights, shape.phases)
        orders = min(4, task.degree + 1)
        given, cost = task.quantities, task.cost
        ends = (tuple(given.lower), tuple(given.upper)) if given is not None else ((), ())
        limited = given.function if given is not None else None
        rates = (None, (), 0.0) if relaxed else (cost.running, cost.weights, cost.jerk)
        self.node = _node(limited, *ends, *rates, shape.count, orders, shape.slacks)
        self.select = _selection(task, shape, local, orders)
        self.width, self.rows = self.node.jacobian.size2_out(0), self.node.jacobian.size1_out(0)


@lru_cache(maxsize=32)
def _node(
    limited: Any, lower: tuple[float, ...], upper: tuple[float, ...], running: Any, weights: tuple[float, ...],
    jerk: float, count: int, orders: int, slacks: int,
) -> _Node:  # fmt: skip
    """The functions of a node; equal tasks share them, because they take longer to make than to use."""
    import casadi as ca

    z, t, slack = ca.SX.sym("z", orders * count), ca.SX.sym("t"), ca.SX.sym("r", slacks)
    curves = [z[m * count : (m + 1) * count] / t**m for m in range(orders)]
    curves += [ca.SX.zeros(count)] * (4 - orders)
    rows, low, high = ca.SX.zeros(0, 1), np.zeros(0), np.zeros(0)
    if limited is not None:
        rows, low, high = _limited(limited(*curves), np.array(lower), np.array(upper), slack)
    rate = jerk * ca.sumsqr(curves[3]) if jerk else ca.SX(0)
    if any(weights):
        rate += ca.dot(ca.DM(weights), running(*curves))
    w = ca.vertcat(z, t, slack)
    cost, rows = ca.cse([t * rate, rows])  # before and after differentiation: a third of the instructions remains
    factor, weight = ca.SX.sym("s"), ca.SX.sym("l", rows.numel())
    slopes = ca.jacobian(rows, w)
    hessian = ca.jacobian(factor * ca.gradient(cost, w) + slopes.T @ weight, w)
    return _Node(
        value=ca.Function("node", [w], [cost, rows], {"cse": True}),
        gradient=ca.Function("node_gradient", [w], [ca.gradient(cost, w)], {"cse": True}),
        jacobian=ca.Function("node_jacobian", [w], [slopes], {"cse": True}),
        hessian=ca.Function("node_hessian", [w, factor, weight], [hessian], {"cse": True}),
        lower=low,
        upper=high,
    )


def _limited(values: Any, lower: Array, upper: Array, slack: Any) -> tuple[Any, Array, Array]:
    """Rows of the quantities in units of their size, and their bounds; with slacks, a row for each limit."""
    import casadi as ca

    scale = sizes(lower, upper)
    scaled = values / ca.DM(scale)
    low, high = lower / scale + TIGHTENING, upper / scale - TIGHTENING
    if not slack.numel():
        kept = np.flatnonzero(np.isfinite(low) | np.isfinite(high))
        return ca.vertcat(*(scaled[int(i)] for i in kept)), low[kept], high[kept]
    above, below = (np.flatnonzero(np.isfinite(ends)) for ends in (high, low))
    sides = [scaled[int(i)] for i in above] + [-scaled[int(i)] for i in below]
    offset = slack.numel() - len(sides)
    rows = ca.vertcat(*(side - slack[offset + k] for k, side in enumerate(sides)))
    return rows, np.full(len(sides), -np.inf), np.concatenate([high[above], -low[below]])


def _selection(task: Task, shape: Shape, local: Array, orders: int) -> Any:
    """Sparse matrix from the variables to w of every node, node by node."""
    from scipy.sparse import coo_array

    knots = clamped_knots(0.0, 1.0, task.spans, task.degree)
    unit = Spline(knots=knots, coefficients=np.eye(shape.controls))
    basis = np.stack([unit(local, order) for order in range(orders)])  # (orders, nodes of a phase, controls)
    basis[np.abs(basis) < 1e-14 * np.abs(basis).max(axis=2, keepdims=True)] = 0.0
    width = orders * shape.count + 1 + shape.slacks
    rows, columns, values = [], [], []
    order, node, control = np.nonzero(basis)
    for phase in range(shape.phases):
        first = phase * len(local) * width
        for k in range(shape.count):
            rows.append(first + node * width + order * shape.count + k)
            columns.append(shape.place(phase, control, k))
            values.append(basis[order, node, control])
        for shift in range(1 + shape.slacks):
            source = shape.duration(phase) if shift == 0 else shape.phases * shape.block + shift - 1
            rows.append(first + np.arange(len(local)) * width + orders * shape.count + shift)
            columns.append(np.full(len(local), source))
            values.append(np.ones(len(local)))
    triplets = (np.concatenate(values), (np.concatenate(rows), np.concatenate(columns)))
    return coo_array(triplets, shape=(width * len(local) * shape.phases, shape.size)).tocsr()


def _assembled(size: int, scale: float, smooth: dict[str, Any], nodes: _Nodes) -> dict[str, Any]:
    """The whole program's functions."""
    import casadi as ca

    x, factor = ca.MX.sym("x", size), ca.MX.sym("s")
    cost, rows = smooth["value"](x)
    _, gradient = smooth["gradient"](x)
    jacobian = smooth["jacobian"](x)[1]
    weight = ca.MX.sym("l", rows.numel() + nodes.rows * nodes.count)
    hessian = smooth["hessian"](x, factor, weight[: rows.numel()])
    select = _casadi(nodes.select)
    w = ca.reshape(select @ x, nodes.width, nodes.count)
    costs, limited = nodes.node.value.map(nodes.count)(w)
    shares = scale * ca.DM(nodes.weights).T
    cost += ca.dot(shares, costs)
    slopes = nodes.node.gradient.map(nodes.count)(w)
    gradient += select.T @ ca.vec(slopes * ca.repmat(shares, nodes.width, 1))
    jacobian = ca.vertcat(jacobian, _spread_jacobian(nodes, w))
    given = ca.reshape(weight[rows.numel() :], nodes.rows, nodes.count)
    curved = nodes.node.hessian.map(nodes.count)(w, factor * shares, given)
    hessian += _spread_hessian(nodes, curved)
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


def _spread_jacobian(nodes: _Nodes, w: Any) -> Any:
    """Jacobian of the node rows by the variables: each entry of the small one times a row of the selection."""
    pattern = nodes.node.jacobian.sparsity_out(0)
    row, column = (np.array(part, dtype=np.int64) for part in pattern.get_triplet())
    own = np.arange(nodes.count)[:, None]
    rows, columns = (own * nodes.rows + row).ravel(), (own * nodes.width + column).ravel()
    entry, place, value = _expanded(nodes.select, columns)
    sparse = nodes.node.jacobian.map(nodes.count)(w)
    shape = (nodes.rows * nodes.count, nodes.select.shape[1])
    return _scattered(sparse, rows[entry], place, entry, value, shape)


def _spread_hessian(nodes: _Nodes, curved: Any) -> Any:
    """Upper triangle of the node Hessians by the variables."""
    pattern = nodes.node.hessian.sparsity_out(0)
    row, column = (np.array(part, dtype=np.int64) for part in pattern.get_triplet())
    own = np.arange(nodes.count)[:, None]
    rows, columns = (own * nodes.width + row).ravel(), (own * nodes.width + column).ravel()
    entry, first, value = _expanded(nodes.select, rows)
    again, second, factor = _expanded(nodes.select, columns[entry])
    entry, first, value = entry[again], first[again], value[again] * factor
    upper = first <= second
    size = nodes.select.shape[1]
    return _scattered(curved, first[upper], second[upper], entry[upper], value[upper], (size, size))


def _expanded(select: Any, rows: Array) -> tuple[Array, Array, Array]:
    """For given rows of a sparse matrix: which of them, column and value of every entry."""
    counts = np.diff(select.indptr)[rows]
    which = np.repeat(np.arange(len(rows)), counts)
    offset = np.arange(counts.sum()) - np.repeat(np.cumsum(counts) - counts, counts)
    place = select.indptr[rows][which] + offset
    return which, select.indices[place], select.data[place]


def _scattered(source: Any, row: Array, column: Array, entry: Array, value: Array, shape: tuple[int, int]) -> Any:
    """Sparse matrix whose entry (row, column) is the sum of value times the given nonzero of the source."""
    import casadi as ca
    from scipy.sparse import coo_array

    key, target = np.unique(column.astype(np.int64) * shape[0] + row, return_inverse=True)
    gather = coo_array((value, (target, entry)), shape=(len(key), source.nnz())).tocsc()
    pattern = ca.Sparsity.triplet(*shape, (key % shape[0]).tolist(), (key // shape[0]).tolist())
    return ca.MX(pattern, _casadi(gather) @ ca.vec(source.nz[:]))


def _casadi(matrix: Any) -> Any:
    import casadi as ca

    matrix = matrix.tocsc()
    matrix.sum_duplicates()
    matrix.sort_indices()
    pattern = ca.Sparsity(*matrix.shape, matrix.indptr.tolist(), matrix.indices.tolist())
    return ca.DM(pattern, matrix.data)
