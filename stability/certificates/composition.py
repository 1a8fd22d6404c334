"""The composition certificate (docs/proof.md): weights that prove an ultimate set for given gains.

``V = sum w_i [ M_i Q_i² / 2 + g_i (θ̂_i - p_i/ε_i)² / (2 δ_i) ]``, where the second part is present only where p_i > 0;
with p_i = 0 the adaptive scalar is a bounded time-varying gain and needs no place in V.

The convex program finds the numbers; nothing here proves anything. `checker.py` does, in exact arithmetic.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..loops.model import Bounds, Gains, LoopModel
from ..loops.rows import ErrorRows, error_rows
from .certificate import Certificate, Failure
from .weights import AdaptationCost, Weights, program

Array = NDArray[np.float64]

#: The assumed box and input error grow by this factor over what an iterate needs…
WIDENING = 1.008
#: …and are accepted once they keep this room, so that the exact check, which rounds outwards, is strict as well.
ROOM = 1.002


@dataclass(frozen=True, kw_only=True)
class Composition(Certificate):
    """A composition certificate: the box and the ultimate set bound the errors Q_i, `input_bound` the input error.

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
        gains: One for each controlled row.
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
        self.adaptive = np.array([adaptive and row.controlled for row in model.rows])
        self.epsilon, self.delta, self.sigma = np.tile([[0.0], [1.0], [1.0]], len(model.rows))
        for i, g in zip(model.controlled, gains, strict=True):
            self.epsilon[i], self.delta[i], self.sigma[i] = g.epsilon, g.delta, g.sigma
        self.adaptive &= self.epsilon > 0

    def run(self) -> Composition | Failure:
        half_widths = np.maximum(self.initial, 1e-9 * self.limit)
        scales = self._scales()
        input_bound = np.zeros(len(self.model.inputs))
        decay: float | None = None
        for step in range(self.STEPS):
            try:
                rows = error_rows(self.model, self.bounds, self.gains, half_widths, input_bound)
            except (ZeroDivisionError, ValueError) as error:
                return Failure(reason=f"the model cannot be bounded over the box: {error}")
            if decay is None or step % 6 == 5:
                decay = self._best_decay(rows, scales, decay)
            found = None if decay is None else self._solve(rows, scales, decay)
            if found is None or decay is None:
                return Failure(
                    reason="the gain conditions hold for no weights",
                    row=_weakest(rows),
                    margin=_lacking(rows, half_widths),
                )
            needed, ultimate = self._sizes(rows, found, decay)
            needed = np.minimum(needed, np.maximum(self.initial * ROOM, rowwise_sizes(rows, half_widths)))
            ultimate = np.minimum(ultimate, half_widths)
            if (needed * ROOM <= half_widths).all() and (rows.input_bound * ROOM <= input_bound).all():
                return Composition(
                    decay=decay,
                    weights=found.weights,
                    young=found.young,
                    leak=found.leak,
                    half_widths=half_widths,
                    input_bound=input_bound,
                    ultimate=ultimate,
                    effort=rows.effort,
                    states=rows.states,
                    rows=rows,
                )
            if (needed > self.limit).any():
                worst = int(np.argmax(needed / self.limit))
                return Failure(
                    reason="the certified set outgrows the operating box", row=worst, margin=_lacking(rows, needed)
                )
            half_widths = np.where(needed * ROOM <= half_widths, half_widths, needed * WIDENING)
            input_bound = np.where(rows.input_bound * ROOM <= input_bound, input_bound, rows.input_bound * WIDENING)
        return Failure(reason=f"the box did not settle in {self.STEPS} iterations")

    def _scales(self) -> Array:
        """Unit of each error in which the program is well conditioned: each row's is that of its target times ½β."""
        gains = dict(zip(self.model.controlled, self.gains, strict=True))
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
        return math.inf if found is None else float(self._sizes(rows, found, decay)[1][0])

    def _solve(self, rows: ErrorRows, scales: Array, decay: float) -> Weights | None:
        adaptive = self.adaptive & (self.delta * self.sigma >= decay) & (rows.control_gain > 0)
        return program(len(scales), bool(adaptive.any())).solve(
            rows, scales, decay, AdaptationCost.of(rows, adaptive, self.epsilon, self.delta, self.sigma)
        )

    def _sizes(self, rows: ErrorRows, found: Weights, decay: float) -> tuple[Array, Array]:
        """Sizes of the invariant set, and of the set that holds the errors after the transient."""
        level = ultimate_level(rows, found, decay, self.epsilon, self.delta, self.sigma)
        start = initial_level(rows, found, self.initial, self.epsilon, self.delta)
        settled = level + max(0.0, start - level) * math.exp(-decay * self.bounds.transient)
        scale = found.weights * rows.mass_low
        return np.sqrt(2 * max(level, start) / scale), np.sqrt(2 * settled / scale)


def rowwise_sizes(rows: ErrorRows, half_widths: Array) -> Array:
    """Radii that no single row can leave while the others stay inside theirs (first exit), inf where none exists.

    At ``|Q_i| = R_i`` row i gives ``M_i |Q_i|' <= S_ii R_i + sum_j |S_ij| R_j + D_i``, negative beyond this radius.
    """
    size = np.maximum(np.abs(rows.low), np.abs(rows.high))
    np.fill_diagonal(size, 0.0)
    pull = -np.diag(rows.high)
    push = size @ half_widths + rows.disturbance
    return np.divide(push, pull, out=np.full_like(push, math.inf), where=pull > 0)


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
