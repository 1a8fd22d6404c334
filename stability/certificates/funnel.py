"""Funnel obligations of the barrier law: |Q_i(t)| < o_i(t) for every t, without relying on the adaptation.

    κ_i = -(β_i + ε_i θ̂_i / (o_i² - Q_i²)) Q_i / 2,     θ̂_i' = -δ_i σ_i θ̂_i + ε_i δ_i (Q_i / (o_i² - Q_i²))² / 2
    o_i(t) = (shoot_i - bound_i) exp(-rate_i t) + bound_i,   Q_i' = g_i (Q_{i+1} + κ_i) + d_i - κ_{i-1}'

The set |Q_i| <= r_i := (1 - ρ) o_i cannot be left first through row i where

    g_min β_i r_i / 2 > g_max r_{i+1} + D_i + sup|κ_{i-1}'| + |r_i'|,

because θ̂ >= 0 only helps. The barrier's κ' is bounded on that set alone, which is why ρ > 0 is proved with it. Held
inputs add T sup|κ_n'| to D_n, and may not step over what is left of the funnel: ρ o_n > T sup|Q_n'|.

Source: Heydari Shahna (2025), P-5 to P-7, for law and funnel; the conditions are derived here.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from itertools import pairwise

from ..enclosures.interval import Interval

#: Parts of the time axis on which the funnels are bounded; the last reaches to infinity.
WINDOWS = 64


@dataclass(frozen=True, kw_only=True)
class FunnelRow:
    """One subsystem under the barrier law.

    Attributes:
        beta: β > 0.
        epsilon: ε >= 0.
        delta: δ > 0.
        sigma: σ > 0.
        gain: Range of g, above 0.
        disturbance: Bound on |d|, couplings that are not to the next row included.
        shoot: o(0) > 0.
        bound: o(∞), at most `shoot`.
        rate: Decay of the funnel, 1/s.

    Raises:
        ValueError: numbers outside these ranges.
    """

    beta: float
    epsilon: float
    delta: float
    sigma: float
    gain: Interval
    disturbance: float
    shoot: float
    bound: float
    rate: float

    def __post_init__(self) -> None:
        positive = (self.beta, self.delta, self.sigma, self.gain.low, self.bound)
        others = (self.epsilon, self.disturbance, self.rate, self.shoot - self.bound)
        if not (all(v > 0 for v in positive) and all(v >= 0 for v in others)):
            raise ValueError(
                "a funnel row needs positive β, δ, σ, gain and bound, shoot >= bound, and no negative ε, disturbance "
                f"or rate: got {self}"
            )

    def width(self, start: float, end: float) -> Interval:
        """Range of o(t) for t in [start, end]; `end` may be infinite."""
        spare = Interval(self.shoot) - Interval(self.bound)
        early, late = ((-(Interval(self.rate) * Interval(t))).exp() for t in (start, end))
        return Interval(self.bound) + spare * Interval(late.low, early.high)


@dataclass(frozen=True, kw_only=True)
class Margin:
    """One obligation, decided by outward-rounded intervals.

    Attributes:
        name: "funnel", "step" or "saturation", and the row.
        statement: What was to be shown.
        value: Distance from failing, in the unit of Q_i' ("step": of Q_i); proved where positive.
        remedy: The smallest change that would do; empty where it holds.
    """

    name: str
    statement: str
    value: float
    remedy: str

    @property
    def verdict(self) -> str:
        """Proved where the margin is positive, undecided where it is not."""
        return "proved" if self.value > 0 else "undecided"


def funnel_margins(
    rows: tuple[FunnelRow, ...], share: float, *, period: float = 0.0, limit: float = math.inf
) -> tuple[Margin, ...]:
    """Margins of the funnel obligations for every t >= 0.

    Args:
        rows: The subsystems, in strict-feedback order; the last one's κ is the input.
        share: ρ, the part of each funnel that stays unused, 0 < ρ < 1.
        period: Control period, s; 0 for a continuous law.
        limit: Amplitude limit of the input; infinite for none.

    Returns:
        For each row "funnel", for the last one "step" where sampled and "saturation" where limited. What holds, holds
        for trajectories with |Q_i(0)| <= (1 - ρ) o_i(0) and θ̂_i(0) = 0.

    Raises:
        ValueError: ρ outside (0, 1).

    Not guaranteed: tightness; the sampled form bounds the held input's error by a constant. Measurement noise and the
    rounding of the controller are not covered.
    """
    if not 0 < share < 1:
        raise ValueError(f"the unused share of a funnel lies between 0 and 1: got {share:g}; try 0.2")
    slowest = min((row.rate for row in rows if row.rate > 0), default=1.0)
    times = [*(8.0 / slowest * k / (WINDOWS - 1) for k in range(WINDOWS)), math.inf]
    found: dict[str, Margin] = {}
    for start, end in pairwise(times):
        for margin in _Window(rows, share, period, limit, start, end).margins():
            if margin.name not in found or margin.value < found[margin.name].value:
                found[margin.name] = margin
    return tuple(found.values())


class _Window:
    """All quantities on one part of the time axis."""

    def __init__(
        self, rows: tuple[FunnelRow, ...], share: float, period: float, limit: float, start: float, end: float
    ) -> None:
        self.rows, self.share, self.period, self.limit = rows, share, Interval(period), limit
        self.width = [row.width(start, end) for row in rows]
        self.shrink = [
            (width - Interval(row.bound)) * Interval(row.rate) for row, width in zip(rows, self.width, strict=True)
        ]
        self.kept = Interval(1.0) - Interval(share)
        self.radius = [self.kept * width for width in self.width]
        # o² - Q² >= o² (1 - (1 - ρ)²) on the set
        self.rest = Interval(1.0) - self.kept.square()

    def margins(self) -> list[Margin]:
        half, made = Interval(0.5), []
        rate = Interval(0.0)  # sup|κ'| of the row before
        last = len(self.rows) - 1
        for i, row in enumerate(self.rows):
            radius, gap = self.radius[i], self.width[i].square() * self.rest
            slope = radius / gap
            # θ̂ may be as large as the narrowest funnel makes it, where |Q| / (o² - Q²) is largest
            narrow = self.kept / (Interval(row.bound) * self.rest)
            theta = _largest(Interval(row.epsilon) * narrow.square() / (Interval(2.0) * Interval(row.sigma)))
            local = half * (
                Interval(row.beta)
                + Interval(row.epsilon) * theta * (Interval(1.0) + self.kept.square()) / (gap * self.rest)
            )
            control = _largest(half * (Interval(row.beta) + Interval(row.epsilon) * theta / gap) * radius)
            following = self.radius[i + 1] if i < last else Interval(0.0)
            push = Interval(row.disturbance) + rate
            speed = _largest(Interval(row.gain.high) * (_largest(following) + control) + push)
            adapted = half * Interval(row.epsilon) * Interval(row.delta) * narrow.square()
            moved = half * Interval(row.epsilon) * slope * _largest(adapted)
            shrunk = Interval(row.epsilon) * theta * radius * self.width[i] * self.shrink[i] / gap.square()
            rate = _largest(local * speed + moved + shrunk)
            input_bound = self.period * rate * Interval(row.gain.high) if i == last else Interval(0.0)
            outward = Interval(row.gain.high) * following + push + self.shrink[i] * self.kept
            pull = half * Interval(row.gain.low) * Interval(row.beta) * radius
            made.append(
                _margin(
                    f"funnel {i + 1}", "|Q| stays below (1 - ρ) o", (pull - outward - input_bound).low, 2.0 * pull.low
                )
            )
            if i == last and self.period.high > 0:
                spare = Interval(self.share) * self.width[i] - self.period * speed
                made.append(_margin(f"step {i + 1}", "a period cannot step over the funnel", spare.low, 0.0))
            if i == last and math.isfinite(self.limit):
                spare = Interval(row.gain.low) * Interval(self.limit) - push - self.shrink[i]
                made.append(_margin(f"saturation {i + 1}", "the limited input holds the funnel", spare.low, 0.0))
        return made


def _largest(interval: Interval) -> Interval:
    return Interval(0.0, interval.magnitude)


def _margin(name: str, statement: str, value: float, pull: float) -> Margin:
    if value > 0:
        return Margin(name=name, statement=statement, value=value, remedy="")
    remedies = {
        "funnel": f"{abs(value):.4g} less disturbance and coupling",
        "step": "a shorter control period, or a wider funnel",
        "saturation": f"{abs(value):.4g} less disturbance, or as much more input",
    }
    remedy = remedies[name.split()[0]]
    if pull > 0:
        remedy += f", or a β that is {1 - 2 * value / pull:.3g} times as large"
    return Margin(name=name, statement=statement, value=value, remedy=remedy)
