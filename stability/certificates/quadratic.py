"""The quadratic certificate for any linear inclusion, continuous or sampled.

    z' (or z(t + T)) = (A + sum_k δ_k l_k r_k') z + B w,    |δ_k(t)| <= 1, |w_j(t)| <= 1

With V = z'Pz, multipliers τ for w and Λ for δ, one matrix inequality in (P, τ, Λ) gives V' <= -αV + Σ τ_j (sampled:
V(t + T) <= (1 - α) V + Σ τ_j), so that ultimately V <= Στ/α and |c'z|² <= c'P^-1 c · Στ/α. One multiplier for each
uncertain entry: no 2^k vertices (Boyd et al. 1994, ch. 5 and 6).

`search` asks Clarabel and proves nothing; `prove` decides the rounded numbers by exact rational LDLᵀ.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from fractions import Fraction
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..loops.rows import ErrorRows
from .definite import positive_definite

Array = NDArray[np.float64]

#: Strictness asked of the solver, relative to a matrix whose states are scaled to one.
MARGIN = 1e-7
#: Uncertainties and disturbances below this share of the largest are enlarged to it, which is on the safe side.
SMALLEST = 1e-5
#: Significant digits of P, τ and Λ in the exact check.
DIGITS = 10


@dataclass(frozen=True, kw_only=True)
class Inclusion:
    """A linear inclusion.

    Attributes:
        a: A. Shape (n, n).
        b: B, one column a disturbance of size 1. Shape (n, m).
        left: l_k as columns. Shape (n, k).
        right: r_k as rows. Shape (k, n).
        sampled: True for a map over a period, False for a differential inclusion.
    """

    a: Array
    b: Array
    left: Array
    right: Array
    sampled: bool


@dataclass(frozen=True, kw_only=True)
class Quadratic:
    """An ellipsoid that holds the state ultimately.

    Attributes:
        p: P, scaled so that the ellipsoid is z'Pz <= 1. Shape (n, n).
        tau: τ, with Στ <= α. Shape (m,).
        multipliers: Λ. Shape (k,).
        decay: α, 1/s; or per period where sampled.
        bound: Ultimate bound on |c'z|.
        output: c. Shape (n,).
    """

    p: Array
    tau: Array
    multipliers: Array
    decay: float
    bound: float
    output: Array


def from_error_rows(rows: ErrorRows, scale: Array) -> Inclusion:
    """The continuous error dynamics, each interval entry an uncertainty of its own.

    Args:
        rows: Enclosures of the loop.
        scale: Expected size of each error, by which tiny uncertainties are enlarged. Shape (n,).
    """
    low = np.minimum(rows.low / rows.mass_low[:, None], rows.low / rows.mass_high[:, None])
    high = np.maximum(rows.high / rows.mass_low[:, None], rows.high / rows.mass_high[:, None])
    return _entries((low + high) / 2, (high - low) / 2, rows.disturbance / rows.mass_low, scale, sampled=False)


def _entries(middle: Array, radius: Array, push: Array, scale: Array, *, sampled: bool) -> Inclusion:
    speed = float(np.abs(middle * scale[None, :] / scale[:, None]).max())
    radius = np.where(radius > 0, np.maximum(radius, SMALLEST * speed * scale[:, None] / scale[None, :]), 0.0)
    push = np.where(push > 0, np.maximum(push, SMALLEST * float(np.max(push / scale)) * scale), 0.0)
    rows, columns = np.nonzero(radius > 0)
    size = np.sqrt(radius[rows, columns])
    n, k = len(push), len(rows)
    left, right = np.zeros((n, k)), np.zeros((k, n))
    left[rows, np.arange(k)] = right[np.arange(k), columns] = size
    acting = push > 0
    return Inclusion(a=middle, b=np.diag(push)[:, acting], left=left, right=right, sampled=sampled)


def search(
    inclusion: Inclusion, output: Array, scale: Array, *, decays: Array | None = None, rounds: int = 1
) -> Quadratic | None:
    """The smallest ultimate bound on |c'z| that a line search over the decay finds.

    Args:
        inclusion: The inclusion.
        output: c. Shape (n,).
        scale: Expected size of each state; the program is solved in these units. Shape (n,).
        decays: Rates to try first; by default a grid below the slowest mode.
        rounds: Refinements of the grid around its best entry.

    Returns:
        The numbers, not proved; None where the solver finds nothing.
    """
    left, right = inclusion.left / scale[:, None], inclusion.right * scale[None, :]
    balance = np.sqrt(np.linalg.norm(right, axis=1) / np.linalg.norm(left, axis=0))
    unit = Inclusion(
        a=inclusion.a * scale[None, :] / scale[:, None],
        b=inclusion.b / scale[:, None],
        left=left * balance[None, :],
        right=right / balance[:, None],
        sampled=inclusion.sampled,
    )
    grid = _grid(unit) if decays is None else np.asarray(decays, dtype=np.float64)
    if not grid.size:
        return None
    size = float(np.abs(output * scale).max())  # the solver's tolerances are absolute
    best: tuple[float, float, Any] | None = None
    for _ in range(rounds + 1):
        for decay in grid:
            found = _solve(unit, output * scale / size, float(decay))
            if found is not None and (best is None or found[0] < best[0]):
                best = (found[0], float(decay), found[1])
        if best is None:
            return None
        near = grid[np.argsort(np.abs(grid - best[1]))[:3]]
        grid = np.linspace(near.min(), near.max(), 5)[1:-1]
    if best is None:
        return None
    squared, decay, (p, tau, multipliers) = best
    inverse = 1 / scale
    return Quadratic(
        p=p * np.outer(inverse, inverse), tau=tau, multipliers=multipliers / balance**2, decay=decay,
        bound=size * math.sqrt(squared),
        output=np.asarray(output, dtype=np.float64),
    )  # fmt: skip


def _grid(unit: Inclusion) -> Array:
    poles = np.linalg.eigvals(unit.a)
    top = 1 - float(np.max(np.abs(poles))) ** 2 if unit.sampled else -2 * float(np.max(poles.real))
    return top * np.array([0.1, 0.25, 0.4, 0.55, 0.7, 0.85]) if top > 0 else np.zeros(0)


def inequality(inclusion: Inclusion, p: Array, tau: Array, multipliers: Array, decay: Any) -> Array:
    """The matrix that must be positive definite, linear in (P, τ, Λ); floats, or fractions in arrays of objects.

    Blocks over (z, w, δ): ``-(A'P + PA + αP + R'ΛR), -PB, -PL; diag τ, 0; Λ``, or for a map
    ``(1 - α)P - R'ΛR - A'PA, …, diag τ - B'PB, …, Λ - L'PL``.
    """
    n = len(p)
    whole = np.hstack([inclusion.a, inclusion.b, inclusion.left])
    forward = p @ whole
    result = np.zeros((whole.shape[1],) * 2, dtype=forward.dtype)
    if inclusion.sampled:
        result -= whole.T @ forward
    else:
        result[:n] -= forward
        result[:, :n] -= forward.T
    result[:n, :n] += (1 - decay) * p if inclusion.sampled else -decay * p
    for size, row in zip(multipliers, inclusion.right, strict=True):
        result[:n, :n] -= size * np.outer(row, row)
    result[np.diag_indices(len(result))] += np.concatenate([0 * p[0], tau, multipliers])
    return result


def _solve(unit: Inclusion, output: Array, decay: float) -> tuple[float, tuple[Array, Array, Array]] | None:
    """Minimise c'P^-1 c with Στ <= α; variables: the upper triangle of P, τ, Λ, t."""
    import importlib

    from scipy import sparse

    clarabel: Any = importlib.import_module("clarabel")  # its types are in a compiled module

    n, m, k = len(unit.a), unit.b.shape[1], unit.right.shape[0]
    pairs = [(i, j) for j in range(n) for i in range(j + 1)]
    count = len(pairs) + m + k + 1
    columns = [_condition(unit, pairs, decay, column) for column in range(count - 1)] + [np.zeros((n + m + k,) * 2)]
    blocks = [np.stack([_triangle(c) for c in columns], axis=1)]
    shift = [-MARGIN * _triangle(np.eye(n + m + k))]
    # [P c; c' t] >= 0
    corner = []
    for column in range(count):
        matrix = np.zeros((n + 1, n + 1))
        if column < len(pairs):
            i, j = pairs[column]
            matrix[i, j] = matrix[j, i] = 1.0
        if column == count - 1:
            matrix[n, n] = 1.0
        corner.append(_triangle(matrix))
    fixed = np.zeros((n + 1, n + 1))
    fixed[:n, n] = fixed[n, :n] = output
    blocks.append(np.stack(corner, axis=1))
    shift.append(_triangle(fixed))
    linear = np.zeros((1, count))
    linear[0, len(pairs) : len(pairs) + m] = -1.0
    cones = [clarabel.NonnegativeConeT(1), clarabel.PSDTriangleConeT(n + m + k), clarabel.PSDTriangleConeT(n + 1)]
    matrix = sparse.csc_matrix(-np.vstack([linear, *blocks]))
    right = np.concatenate([[decay], *shift])
    cost = np.zeros(count)
    cost[-1] = 1.0
    settings = clarabel.DefaultSettings()
    settings.verbose = False
    solution = clarabel.DefaultSolver(sparse.csc_matrix((count, count)), cost, matrix, right, cones, settings).solve()
    x = np.asarray(solution.x, dtype=np.float64)
    if not np.isfinite(x).all() or "Infeasible" in str(solution.status) or not x[-1] > 0:
        return None
    p = np.zeros((n, n))
    for (i, j), value in zip(pairs, x, strict=False):
        p[i, j] = p[j, i] = value
    tau, multipliers = x[len(pairs) : len(pairs) + m], x[len(pairs) + m : -1]
    smallest = np.linalg.eigvalsh(inequality(unit, p, tau, multipliers, decay)).min()
    if not smallest > 0 or not np.linalg.eigvalsh(p).min() > 0:
        return None
    return float(output @ np.linalg.solve(p, output)), (p, tau, multipliers)


def _condition(unit: Inclusion, pairs: list[tuple[int, int]], decay: float, column: int) -> Array:
    """The part of the inequality that belongs to one variable."""
    n, m, k = len(unit.a), unit.b.shape[1], unit.right.shape[0]
    p, rest = np.zeros((n, n)), np.zeros(m + k)
    if column < len(pairs):
        i, j = pairs[column]
        p[i, j] = p[j, i] = 1.0
    else:
        rest[column - len(pairs)] = 1.0
    return inequality(unit, p, rest[:m], rest[m:], decay)


def _triangle(matrix: Array) -> Array:
    """Upper triangle by columns, off-diagonal entries times √2, as the solver wants it."""
    size = len(matrix)
    rows, columns = np.array([(i, j) for j in range(size) for i in range(j + 1)]).T
    return matrix[rows, columns] * np.where(rows == columns, 1.0, math.sqrt(2.0))


def prove(inclusion: Inclusion, found: Quadratic) -> Fraction | None:
    """Decide the numbers exactly, rounded to short rationals.

    Returns:
        A bound on |c'z|², proved for the inclusion with its floats taken as exact numbers; None where the inequality
        does not hold.
    """

    def exact(values: Array) -> Any:
        return np.vectorize(Fraction, otypes=[object])(values)

    def short(values: Array) -> Any:
        return np.vectorize(lambda v: Fraction(f"{v:.{DIGITS - 1}e}"), otypes=[object])(values)

    p = short(np.triu(found.p) + np.triu(found.p, 1).T)
    tau, multipliers, decay = short(found.tau), short(found.multipliers), short(np.array([found.decay]))[0]
    if not (decay > 0 and min([*tau, *multipliers], default=Fraction(0)) >= 0 and positive_definite(p.tolist())):
        return None
    plain = Inclusion(
        a=exact(inclusion.a), b=exact(inclusion.b), left=exact(inclusion.left), right=exact(inclusion.right),
        sampled=inclusion.sampled,
    )  # fmt: skip
    if not positive_definite(inequality(plain, p, tau, multipliers, decay).tolist()):
        return None
    level = sum(tau) / decay
    bound = Fraction(f"{found.bound**2 * (1 + 1e-6):.{DIGITS}e}") * max(level, Fraction(1))
    c = exact(found.output)
    corner = np.block([[p, c[:, None]], [c[None, :], np.array([[bound / level]], dtype=object)]])
    return bound if positive_definite(corner.tolist()) else None
