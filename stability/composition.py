"""The composition certificate (theory §3): weights that prove a ball for given gains.

``V = sum w_i [ M_i Q_i² / 2 + g_i (θ̂_i - p_i/ε_i)² / (2 δ_i) ]``, where the second part is present only where p_i > 0;
with p_i = 0 the adaptive scalar is a bounded time-varying gain and needs no place in V.

The convex program finds the numbers; nothing here proves anything. `checker.py` does, in exact arithmetic.
"""

from __future__ import annotations

import math
import warnings
from dataclasses import dataclass
from functools import lru_cache
from itertools import product
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .certificate import Certificate, Failure
from .model import Bounds, Gains, LoopModel
from .rows import ErrorRows, error_rows

Array = NDArray[np.float64]

#: The assumed box and input error grow by this factor over what an iterate needs…
WIDENING = 1.008
#: …and are accepted once they keep this room, so that the exact check, which rounds outwards, is strict as well.
ROOM = 1.002
#: Young's ν is reduced by this share after the solve, which makes the matrix inequality strict.
SLACK = 2e-3


@dataclass(frozen=True, kw_only=True)
class Composition(Certificate):
    """A composition certificate: the box and the ball bound the errors Q_i, `held` the input error.

    Attributes:
        weights: w. Shape (n,).
        young: ν. Shape (n,).
        leak: p = ε θ*. Shape (n,).
        rows: The enclosures over the assumed box.
    """

    weights: Array
    young: Array
    leak: Array
    rows: ErrorRows


def certify(
    model: LoopModel, bounds: Bounds, gains: tuple[Gains, ...], limit: Array, *, adaptive: bool = False
) -> Composition | Failure:
    """Search a composition certificate for fixed gains.

    Args:
        model: Plant and law.
        bounds: Assumptions.
        gains: One for each governed row.
        limit: Largest admissible box, |Q_i| <= limit_i. Shape (n,).
        adaptive: Allow p_i > 0 (θ̂ in V).

    Returns:
        The numbers with the smallest ultimate bound on |Q_1| that was found, or why there are none.

    Not guaranteed: optimality (the box and the input error are found by iteration); proof (see `checker.py`).
    """
    search = _Search(model, bounds, gains, limit, adaptive)
    return search.run()


class _Search:
    """Fixed point of (box, input error) -> (rows, convex program) -> (box, input error)."""

    STEPS = 60

    def __init__(
        self, model: LoopModel, bounds: Bounds, gains: tuple[Gains, ...], limit: Array, adaptive: bool
    ) -> None:
        self.model, self.bounds, self.gains, self.limit = model, bounds, gains, limit
        self.initial = np.array(bounds.initial)
        self.adaptive = np.array([adaptive and row.governed for row in model.rows])
        self.epsilon, self.delta, self.sigma = np.tile([[0.0], [1.0], [1.0]], len(model.rows))
        for i, g in zip(model.governed, gains, strict=True):
            self.epsilon[i], self.delta[i], self.sigma[i] = g.epsilon, g.delta, g.sigma
        self.adaptive &= self.epsilon > 0

    def run(self) -> Composition | Failure:
        radii = np.maximum(self.initial, 1e-9 * self.limit)
        scales = self._scales()
        held = np.zeros(len(self.model.inputs))
        decay: float | None = None
        for step in range(self.STEPS):
            try:
                rows = error_rows(self.model, self.bounds, self.gains, radii, held)
            except (ZeroDivisionError, ValueError) as error:
                return Failure(reason=f"the model cannot be bounded over the box: {error}")
            if decay is None or step % 6 == 5:
                decay = self._best_decay(rows, scales, decay)
            found = None if decay is None else self._solve(rows, scales, decay)
            if found is None or decay is None:
                return Failure(
                    reason="the gain conditions hold for no weights", row=_weakest(rows), margin=_lacking(rows, radii)
                )
            needed, ball = self._radii(rows, found, decay)
            needed = np.minimum(needed, np.maximum(self.initial * ROOM, rowwise_radii(rows, radii)))
            ball = np.minimum(ball, radii)
            if (needed * ROOM <= radii).all() and (rows.held * ROOM <= held).all():
                return Composition(
                    decay=decay, weights=found.weights, young=found.young, leak=found.leak, radii=radii, held=held,
                    ball=ball, effort=rows.effort, states=rows.states, rows=rows,
                )  # fmt: skip
            if (needed > self.limit).any():
                worst = int(np.argmax(needed / self.limit))
                return Failure(
                    reason="the certified set outgrows the operating box", row=worst, margin=_lacking(rows, needed)
                )
            radii = np.where(needed * ROOM <= radii, radii, needed * WIDENING)
            held = np.where(rows.held * ROOM <= held, held, rows.held * WIDENING)
        return Failure(reason=f"the box did not settle in {self.STEPS} iterations")

    def _scales(self) -> Array:
        """Unit of each error in which the program is well conditioned: each row's is that of its target times ½β."""
        gains = dict(zip(self.model.governed, self.gains, strict=True))
        scales: list[float] = []
        for row in self.model.rows:
            if isinstance(row.target, int):
                scales.append(scales[row.target] * gains[row.target].beta / 2)
            else:
                same = [k for k, other in enumerate(self.model.rows[: len(scales)]) if other.unit == row.unit]
                scales.append(scales[same[-1]] if same else 1.0)
        return np.array(scales)

    def _best_decay(self, rows: ErrorRows, scales: Array, previous: float | None) -> float | None:
        """Line search over μ for the smallest ultimate bound; geometric, then golden."""
        top = 2.0 * float(np.min(-np.diag(rows.high) / rows.mass_high))
        if not top > 0:
            return None
        if previous is None:
            candidates = top * np.array([0.15, 0.3, 0.45, 0.6, 0.75, 0.9])
        else:
            candidates = previous * np.array([0.85, 0.93, 1.0, 1.07, 1.15])
        bounds = [self._bound(rows, scales, mu) for mu in candidates]
        best = int(np.argmin(bounds))
        if not math.isfinite(bounds[best]):
            return None
        if previous is not None or best in (0, len(bounds) - 1):
            return float(candidates[best])
        low, high = candidates[best - 1], candidates[best + 1]
        return _golden(lambda mu: self._bound(rows, scales, mu), low, high)

    def _bound(self, rows: ErrorRows, scales: Array, decay: float) -> float:
        found = self._solve(rows, scales, decay)
        return math.inf if found is None else float(self._radii(rows, found, decay)[1][0])

    def _solve(self, rows: ErrorRows, scales: Array, decay: float) -> _Weights | None:
        adaptive = self.adaptive & (self.delta * self.sigma >= decay) & (rows.control_gain > 0)
        return _program(len(scales), bool(adaptive.any())).solve(
            rows, scales, decay, _AdaptationCost.of(rows, adaptive, self.epsilon, self.delta, self.sigma)
        )

    def _radii(self, rows: ErrorRows, found: _Weights, decay: float) -> tuple[Array, Array]:
        """Radii of the invariant set, and of the ball that holds the errors after the transient."""
        level = ultimate_level(rows, found, decay, self.epsilon, self.delta, self.sigma)
        start = initial_level(rows, found, self.initial, self.epsilon, self.delta)
        settled = level + max(0.0, start - level) * math.exp(-decay * self.bounds.transient)
        scale = found.weights * rows.mass_low
        return np.sqrt(2 * max(level, start) / scale), np.sqrt(2 * settled / scale)


def rowwise_radii(rows: ErrorRows, radii: Array) -> Array:
    """Radii that no single row can leave while the others stay inside theirs (first exit), inf where none exists.

    At ``|Q_i| = R_i`` row i gives ``M_i |Q_i|' <= S_ii R_i + sum_j |S_ij| R_j + D_i``, negative beyond this radius.
    """
    size = np.maximum(np.abs(rows.low), np.abs(rows.high))
    np.fill_diagonal(size, 0.0)
    pull = -np.diag(rows.high)
    push = size @ radii + rows.disturbance
    return np.divide(push, pull, out=np.full_like(push, math.inf), where=pull > 0)


@dataclass(frozen=True)
class _Weights:
    weights: Array
    young: Array
    leak: Array


def ultimate_level(rows: ErrorRows, found: Any, decay: float, epsilon: Array, delta: Array, sigma: Array) -> float:
    """c/μ, the value below which V settles."""
    disturbance = found.weights * rows.disturbance**2 / (2 * found.young)
    on = found.leak > 0
    star = np.divide(found.leak, epsilon, out=np.zeros_like(epsilon), where=epsilon > 0)
    leak = found.weights * rows.control_gain * (sigma * star**2 / 2)
    residual = found.weights * rows.control_gain * np.maximum(rows.theta_max, star) * rows.theta_residual / delta
    return float((disturbance.sum() + leak[on].sum() + residual[on].sum()) / decay)


def initial_level(rows: ErrorRows, found: Any, initial: Array, epsilon: Array, delta: Array) -> float:
    """The largest V over the initial errors, with θ̂(0) = 0."""
    on = found.leak > 0
    star = np.divide(found.leak, epsilon, out=np.zeros_like(epsilon), where=epsilon > 0)
    adaptive = found.weights * rows.control_gain * star**2 / (2 * np.where(on, delta, 1.0))
    return float((0.5 * found.weights * rows.mass_high * initial**2).sum() + adaptive[on].sum())


def _weakest(rows: ErrorRows) -> int:
    return int(np.argmax(np.diag(rows.high) / rows.mass_high))


def _lacking(rows: ErrorRows, scale: Array) -> float:
    """How much more decay the weakest row would need for diagonal dominance, 1/s; negative."""
    size = np.maximum(np.abs(rows.low), np.abs(rows.high)) * scale[None, :] / scale[:, None]
    np.fill_diagonal(size, 0.0)
    spare = (-np.diag(rows.high) - size.sum(axis=1)) / rows.mass_high
    return float(min(spare.min(), 0.0))


def _golden(function: Any, low: float, high: float) -> float:
    """Golden-section minimiser of a function that may be infinite; eight evaluations."""
    ratio = (math.sqrt(5) - 1) / 2
    a, b = high - ratio * (high - low), low + ratio * (high - low)
    fa, fb = function(a), function(b)
    for _ in range(6):
        if fa <= fb:
            high, b, fb = b, a, fa
            a = high - ratio * (high - low)
            fa = function(a)
        else:
            low, a, fa = a, b, fb
            b = low + ratio * (high - low)
            fb = function(b)
    return a if fa <= fb else b


@dataclass(frozen=True)
class _AdaptationCost:
    """Coefficients of the cost of p_i > 0: quadratic in r_i = w_i p_i over w_i, and linear in w_i."""

    quadratic: Array
    linear: Array
    gain: Array

    @staticmethod
    def of(rows: ErrorRows, on: Array, epsilon: Array, delta: Array, sigma: Array) -> _AdaptationCost:
        safe = np.where(epsilon > 0, epsilon, 1.0)
        quadratic = np.where(on, rows.control_gain * sigma / (2 * safe**2), 0.0)
        linear = np.where(on, rows.control_gain * rows.theta_max * rows.theta_residual / delta, 0.0)
        return _AdaptationCost(quadratic, linear, np.where(on, rows.control_gain, 0.0))


@lru_cache(maxsize=8)
def _program(n: int, adaptive: bool) -> _Program:
    return _Program(n, adaptive)


class _Program:
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

    def solve(self, rows: ErrorRows, scales: Array, decay: float, adaptation: _AdaptationCost) -> _Weights | None:
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
        return _Weights(weights / weights[0], young, leak)
