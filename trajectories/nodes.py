"""Quantities and running costs at the collocation points of a motion, with derivatives by its variables.

They are functions of w = (x and its derivatives per unit time, T, slacks) at each point, and w is a constant sparse
matrix times the variables: their derivatives are those of one small function, spread by sparse matrices made once.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .quantity import sizes
from .shape import Shape
from .spline import Spline, clamped_knots
from .task import Task

Array = NDArray[np.float64]
Indices = NDArray[np.int64]

#: Collocation points in each span.
POINTS = 3
#: Every limit is kept smaller by this share in the program, so that what the solver's tolerance leaves is inside.
TIGHTENING = 1e-4


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


class Nodes:
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

    curves, slack = ca.SX.sym("c", orders * count), ca.SX.sym("r", slacks)
    given = [curves[m * count : (m + 1) * count] for m in range(orders)] + [ca.SX.zeros(count)] * (4 - orders)
    rows, low, high = ca.SX.zeros(0, 1), np.zeros(0), np.zeros(0)
    if limited is not None:
        rows, low, high = _limited(limited(*given), np.array(lower), np.array(upper), slack)
    rate = jerk * ca.sumsqr(given[3]) if jerk else ca.SX(0)
    if any(weights):
        rate += ca.dot(ca.DM(weights), running(*given))
    rate, rows = ca.cse([rate, rows])  # before and after differentiation: a third of the instructions remains
    z, t = ca.SX.sym("z", orders * count), ca.SX.sym("t")
    factor, weight = ca.SX.sym("s"), ca.SX.sym("l", rows.numel())
    # by the chain rule through position … jerk in time: half the instructions of differentiating by w
    inner, share = ca.vertcat(curves, slack), ca.SX.sym("share")
    slope, slopes = ca.jacobian(rate, inner), ca.jacobian(rows, inner)
    # the gradient of share * rate + weight' rows by (inner, share)
    first = ca.densify(ca.vertcat(share * slope.T + slopes.T @ weight, rate))
    second = ca.jacobian(first, ca.vertcat(inner, share))
    w = ca.vertcat(z, t, slack)
    outer = ca.vertcat(*(z[m * count : (m + 1) * count] / t**m for m in range(orders)), slack)
    outer_share = ca.vertcat(outer, factor * t)
    chain, pull = ca.jacobian(outer_share, w), ca.SX.sym("g", first.numel())
    hessian = chain.T @ second @ chain + ca.substitute(ca.jacobian(chain.T @ pull, w), pull, first)

    def along(name: str, more: list[Any], result: list[Any]) -> Any:
        return ca.Function(name, [w, *more], ca.substitute(result, [inner, share], [outer, factor * t]), {"cse": True})

    gradient = t * (slope @ ca.jacobian(outer, w)).T + rate * ca.jacobian(t, w).T
    return _Node(
        value=along("node", [], [t * rate, rows]),
        gradient=along("node_gradient", [], [gradient]),
        jacobian=along("node_jacobian", [], [slopes @ ca.jacobian(outer, w)]),
        hessian=along("node_hessian", [factor, weight], [hessian]),
        lower=low,
        upper=high,
    )


def _limited(values: Any, lower: Array, upper: Array, slack: Any) -> tuple[Any, Array, Array]:
    """Rows of the quantities in units of their size, and their bounds; with slacks, a row for each limit."""
    import casadi as ca

    scale = sizes(lower, upper)
    scaled = values / ca.DM(scale)
    tight = np.minimum(TIGHTENING, (upper - lower) / scale / 4)
    low, high = lower / scale + tight, upper / scale - tight
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


def spread_jacobian(nodes: Nodes, w: Any) -> Any:
    """Jacobian of the node rows by the variables: each entry of the small one times a row of the selection."""
    rows, columns = _entries(nodes.node.jacobian, nodes.count)
    entry, place, value = _expanded(nodes.select, columns)
    sparse = nodes.node.jacobian.map(nodes.count)(w)
    shape = (nodes.rows * nodes.count, nodes.select.shape[1])
    return _scattered(sparse, rows[entry], place, entry, value, shape)


def spread_hessian(nodes: Nodes, curved: Any) -> Any:
    """Upper triangle of the node Hessians by the variables."""
    rows, columns = _entries(nodes.node.hessian, nodes.count)
    entry, first, value = _expanded(nodes.select, rows)
    again, second, factor = _expanded(nodes.select, columns[entry])
    entry, first, value = entry[again], first[again], value[again] * factor
    upper = first <= second
    size = nodes.select.shape[1]
    return _scattered(curved, first[upper], second[upper], entry[upper], value[upper], (size, size))


def _entries(function: Any, count: int) -> tuple[Indices, Indices]:
    """Rows and columns of the nonzeros of a function's output, as blocks of a diagonal of so many."""
    row, column = (np.array(part, dtype=np.int64) for part in function.sparsity_out(0).get_triplet())
    own = np.arange(count)[:, None]
    return (own * function.size1_out(0) + row).ravel(), (own * function.size2_out(0) + column).ravel()


def _expanded(select: Any, rows: Indices) -> tuple[Indices, Indices, Array]:
    """For given rows of a sparse matrix: which of them, column and value of every entry."""
    counts = np.diff(select.indptr)[rows]
    which = np.repeat(np.arange(len(rows)), counts)
    offset = np.arange(counts.sum()) - np.repeat(np.cumsum(counts) - counts, counts)
    place = select.indptr[rows][which] + offset
    return which, select.indices[place], select.data[place]


def _scattered(source: Any, row: Indices, column: Indices, entry: Indices, value: Array, shape: tuple[int, int]) -> Any:
    """Sparse matrix whose entry (row, column) is the sum of value times the given nonzero of the source."""
    import casadi as ca
    from scipy.sparse import coo_array

    key, target = np.unique(column.astype(np.int64) * shape[0] + row, return_inverse=True)
    gather = coo_array((value, (target, entry)), shape=(len(key), source.nnz())).tocsc()
    pattern = ca.Sparsity.triplet(*shape, (key % shape[0]).tolist(), (key // shape[0]).tolist())
    return ca.MX(pattern, casadi_matrix(gather) @ ca.vec(source.nz[:]))


def casadi_matrix(matrix: Any) -> Any:
    """A SciPy sparse matrix as CasADi's."""
    import casadi as ca

    matrix = matrix.tocsc()
    matrix.sum_duplicates()
    matrix.sort_indices()
    rows, columns = matrix.shape
    pattern = ca.Sparsity(rows, columns, matrix.indptr.tolist(), matrix.indices.tolist())
    return ca.DM(pattern, matrix.data)
