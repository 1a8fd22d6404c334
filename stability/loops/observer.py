"""The sampled motion-state observer: position and speed of a member from its encoder alone.

    e = y - r,   x̂ = ξ + l_1 (e - ξ),   ŝ = η + l_2 (e - ξ),      ξ <- x̂ + T ŝ,   η <- ŝ

in errors from the reference r, which the law adds again; (ξ, η) starts at (e, 0). With l_1 = 1 and l_2 = 1/T the speed
is the difference of two measurements. Source: Heydari Shahna (2025), P-4, for an observer that needs the encoder alone
(its adaptive scalar multiplied e by 1.02 at most and is left out); Luenberger (1971) for its structure.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

#: States of an observer, and what is bounded of it: errors of position and speed, and e - ξ.
STATES, SHOWN = 2, 3


@dataclass(frozen=True, kw_only=True)
class Observer:
    """Gains of an observer.

    Attributes:
        first: l_1, above 0 and at most 1.
        second: l_2 > 0, 1/s.

    Raises:
        ValueError: numbers outside these ranges.
    """

    first: float
    second: float

    def __post_init__(self) -> None:
        if not (0 < self.first <= 1 and self.second > 0):
            raise ValueError(f"an observer needs 0 < l_1 <= 1 and l_2 > 0: got {self.first:g} and {self.second:g}")

    @staticmethod
    def of_bandwidth(bandwidth: float | None, period: float) -> Observer:
        """A double real pole at p = exp(-bandwidth · T), in 9 digits; at 0, which is differences, where it is None."""
        away = 1.0 if bandwidth is None else -math.expm1(-bandwidth * period)
        return Observer(first=float(f"{away * (2 - away):.8e}"), second=float(f"{away**2 / period:.8e}"))
