"""A sampled motion-state observer, bounded by a comparison system of two rows.

Obligation: observer. Must fail: a slower observer, a worse encoder, another pole.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from fractions import Fraction
from typing import Any

from .arithmetic import magnitude, up
from .coupling import guarantee_of
from .limits import ROUNDING, NotProvedError, need
from .member import Member
from .obligation import Obligation, decided
from .parsing import number


@dataclass(frozen=True)
class Observer:
    """A sampled motion-state observer with one adaptive scalar, and the coordinates that prove it."""

    first: Fraction
    second: Fraction
    largest: Fraction
    period: Fraction
    pole: Fraction

    def errors(self, noise: Fraction, acceleration: Fraction, initial: Fraction) -> tuple[Fraction, Fraction]:
        """Bounds on the errors of position and speed at every sample, for gains as decimal, float64 and float32.

        In y_1 = e_1, y_2 = e_2 + k e_1 the errors obey |y(t + T)| <= A |y| + b; R = (I - A)^-1 b is not left, and
        neither is any multiple of it that holds the start. For a fixed k each entry is convex in the gains, so it is
        largest where both are at an end of what rounding makes of them; R grows with every entry.
        """
        k = (1 - (1 + self.largest / 2) * self.first - self.pole) / self.period
        ends = (1 - ROUNDING, 1 + ROUNDING)
        corners = [self._entries(k, self.first * p, self.second * q, noise) for p in ends for q in ends]
        a11, a21, b1, b2 = (max(entry) for entry in zip(*corners, strict=True))
        t = self.period
        a12, a22 = t, abs(1 + k * t)
        b1, b2 = b1 + acceleration * t * t / 2, b2 + acceleration * t * (1 + abs(k) * t / 2)
        determinant = (1 - a11) * (1 - a22) - a12 * a21
        if not (a11 < 1 and a22 < 1 and determinant > 0):
            raise NotProvedError("the observer does not contract for every value of its adaptive scalar")
        reach = [((1 - a22) * b1 + a12 * b2) / determinant, (a21 * b1 + (1 - a11) * b2) / determinant]
        start = [noise, initial + abs(k) * noise]
        need(min(reach) > 0, "an observer without any error proves nothing")
        widest = max(Fraction(1), *(s / r for s, r in zip(start, reach, strict=True)))
        reach = [up(widest * r) for r in reach]
        return reach[0], up(reach[1] + abs(k) * reach[0])

    def _entries(self, k: Fraction, first: Fraction, second: Fraction, noise: Fraction) -> tuple[Fraction, ...]:
        """What depends on the gains: A's first column, and the encoder's part of b."""
        middle, spread, t = 1 + self.largest / 2, self.largest / 2, self.period
        inward, factor = second + k * first, (1 + self.largest) * noise
        a11 = abs(1 - middle * first - k * t) + spread * abs(first)
        a21 = abs(-middle * inward + k - k * (1 + k * t)) + spread * abs(inward)
        return a11, a21, factor * abs(first), factor * abs(inward)


def observer_of(data: dict[str, Any], member: Member) -> Observer:
    """The observer of a member: what it is from the study, its gains and the coordinates of its proof from the file."""
    section = next(m for m in data["members"] if m["name"] == member.name)["observer"]
    first, second, pole = (number(section[key], f"the observer's {key}") for key in ("first", "second", "pole"))
    largest = number(data["study"]["controller"]["observer"]["largest"], "the observer's largest")
    need(first > 0 and second > 0 and largest >= 0, "the observer's gains must be positive")
    asked = data["study"]["controller"]["observer"]
    bandwidth = number(asked["bandwidth_rad_s"], "bandwidth_rad_s")
    need(
        number(asked["epsilon"], "epsilon") >= 0 and number(asked["sigma"], "sigma") > 0, "an observer adapts forwards"
    )
    away = -math.expm1(-float(bandwidth * member.claim.period)) if bandwidth > 0 else 0.0
    middle = float(1 + largest / 2)
    wanted = 2 * away / middle, away**2 / (float(member.claim.period) * middle)
    close = all(abs(float(g) - w) <= 1e-3 * w for g, w in zip((first, second), wanted, strict=True))
    need(away > 0 and close, "the observer's gains are not those of its bandwidth")
    return Observer(first, second, largest, member.claim.period, pole)


def observed(data: dict[str, Any], members: list[Member]) -> Obligation:
    """The assumed measurement errors have room for the errors of the observers."""
    found = []
    noise = data["study"]["uncertainty"].get("noise", {})
    for member in members:
        claim = member.claim
        encoder = number(noise[claim.rows[0]["state"]], "the encoder's error")
        need(claim.first == "position", "an observer estimates a position and its rate")
        acceleration = guarantee_of(data, member.name)[2] + claim.period * magnitude(claim.reference[3])
        # |v(0) - r'(0)| where |Q_2(0)| and |Q_1(0)| are bounded
        start = claim.initial[1] + member.loop.gain[0].beta[1] / 2 * claim.initial[0]
        position, speed = observer_of(data, member).errors(encoder, acceleration, start)
        found += [room_for(claim.noise[0], position), room_for(claim.noise[1], speed)]
    statement = "the errors of every observer are inside the assumed measurement errors"
    return decided("observer", statement, min(found), "1", "an observer that is faster, or a better encoder")


def room_for(assumed: Fraction, error: Fraction) -> Fraction:
    """Room relative to what is assumed; where both are the same number there is room enough."""
    if assumed < error:
        return -Fraction(1)
    return (assumed - error) / assumed + Fraction(1, 10**12) if assumed > 0 else Fraction(1)
