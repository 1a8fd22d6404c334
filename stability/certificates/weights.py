"""The convex program of the composition certificate: weights, Young's ν and leaks for one decay rate."""

from __future__ import annotations

import warnings
from dataclasses import dataclass
from functools import lru_cache
from itertools import product
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..loops.rows import ErrorRows

Array = NDArray[np.float64]

#: Young's ν is reduced by this share after the solve, which makes the matrix inequality strict.
SLACK = 2e-3


@dataclass(frozen=True)
class Weights:
    """w, ν and p of every row. Shapes (n,)."""

    weights: Array
    young: Array
    leak: Array


@dataclass(frozen=True)
class AdaptationCost:
    """Coefficients of the cost of p_i > 0: quadratic in r_i = w_i p_i over w_i, and linear in w_i."""

    quadratic: Array
    linear: Array
    gain: Array

    @staticmethod
    def of(rows: ErrorRows, on: Array, epsilon: Array, delta: Array, sigma: Array) -> AdaptationCost:
        """The coefficients of given gains; `on` where a row may adapt."""
        safe = np.where(epsilon > 0, epsilon, 1.0)
        quadratic = np.where(on, rows.control_gain * sigma / (2 * safe**2), 0.0)
        linear = np.where(on, rows.control_gain * rows.theta_max * rows.theta_residual / delta, 0.0)
        return AdaptationCost(quadratic, linear, np.where(on, rows.control_gain, 0.0))


@lru_cache(maxsize=8)
def program(n: int, adaptive: bool) -> Program:
    """The program of a size, built once."""
    return Program(n, adaptive)


class Program:
    """The convex program in (w, m, r), built once for each size and solved with new data."""

    def __init__(self, n: int, adaptive: bool) -> None:
        import cvxpy as cp

        self.n, self.adaptive = n, adaptive
        self.middle, self.radius = cp.Parameter((n, n)), cp.Parameter((n, n), nonneg=True)
        self.diagonal, self.disturbance = cp.Parameter(n), cp.Parameter(n, nonneg=True)
        self.gain, self.quadratic, self.linear = (cp.Parameter(n, nonneg=True) for _ in range(3))
        self.w, self.m, self.r = cp.Variable(n), cp.Variable(n), cp.Variable(n, nonneg=True)
        cost = sum(cp.quad_over_lin(self.disturbance[i] * self.w[i], self.m[i]) for i in range(n)) / 2
        constraints: list[Any] = [self.w[0] == 1, self.w >= 1e-9, self.m >= 1e-9]
        if adaptive:
            roots = self.quadratic
            cost += sum(cp.quad_over_lin(roots[i] * self.r[i], self.w[i]) for i in range(n)) + self.linear @ self.w
        else:
            constraints.append(self.r == 0)
        constraints += [self._matrix(cp, (1, *signs)) >> 0 for signs in product((1, -1), repeat=n - 1)]
        self.problem = cp.Problem(cp.Minimize(cost), constraints)

    def _matrix(self, cp: Any, signs: tuple[int, ...]) -> Any:
        n, w = self.n, self.w
        rows = []
        for i in range(n):
            row: list[Any] = []
            for j in range(n):
                if i == j:
                    row.append(w[i] * self.diagonal[i] + self.gain[i] * self.r[i] / 2 - self.m[i] / 2)
                else:
                    spread = signs[i] * signs[j] * (w[i] * self.radius[i, j] + w[j] * self.radius[j, i])
                    row.append(-(w[i] * self.middle[i, j] + w[j] * self.middle[j, i] + spread) / 2)
            rows.append(row)
        return cp.bmat(rows)

    def solve(self, rows: ErrorRows, scales: Array, decay: float, adaptation: AdaptationCost) -> Weights | None:
        """Solve for one μ; None where the solver finds nothing usable."""
        import cvxpy as cp

        ratio = scales[None, :] / (scales[:, None] * rows.mass_high[:, None])
        low, high = rows.low * ratio, rows.high * ratio
        self.middle.value, self.radius.value = (low + high) / 2, (high - low) / 2
        self.diagonal.value = -np.diag(high) - decay / 2
        self.disturbance.value = rows.disturbance / (scales * rows.mass_high)
        unit = float(self.disturbance.value.max()) or 1.0
        self.disturbance.value = self.disturbance.value / unit
        self.gain.value = adaptation.gain / rows.mass_high
        cost = 1.0 / (scales**2 * rows.mass_high * unit**2)
        self.quadratic.value, self.linear.value = np.sqrt(adaptation.quadratic * cost), adaptation.linear * cost
        with warnings.catch_warnings():
            warnings.filterwarnings("ignore", message="Solution may be inaccurate", category=UserWarning)
            try:
                # a warm start would make the answer depend on what this process solved before
                self.problem.solve(solver=cp.CLARABEL, warm_start=False)
            except cp.SolverError:
                return None
        if self.problem.status not in (cp.OPTIMAL, cp.OPTIMAL_INACCURATE):
            return None
        w, m, r = (np.asarray(v.value, dtype=float) for v in (self.w, self.m, self.r))
        if not (np.isfinite([w, m, r]).all() and (w > 0).all() and (m > 0).all()):
            return None
        young = m / w * (1 - SLACK) * rows.mass_high
        leak = np.where(r / w > 1e-6 * young / np.maximum(rows.mass_high, 1e-300), r / w, 0.0) * (self.gain.value > 0)
        weights = w / (scales**2 * rows.mass_high)
        return Weights(weights / weights[0], young, leak)
