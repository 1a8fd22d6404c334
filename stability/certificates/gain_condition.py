"""The gain condition of a continuous law, decided exactly: does V of a composition certificate decay (theory §3)?

    P_ii = -w_i S_ii⁺ + ½ g_i w_i p_i - ½ w_i ν_i - ½ μ w_i M_i⁺,     P_ij ∈ -½ (w_i [S_ij] + w_j [S_ji])

is positive definite where it is at 2^(n-1) sign vertices (Rohn 1994), each decided by exact elimination. The rows are
enclosures rounded outwards, so what is decided here holds for the law without load networks and with the input that the
certificate assumes; a gain file is proved otherwise, by `impulse.py` and the checker.
"""

from __future__ import annotations

from dataclasses import dataclass
from fractions import Fraction
from itertools import product

from .composition import Composition
from .definite import positive_definite

#: Steps of the bisections for margins.
STEPS = 10


@dataclass(frozen=True, kw_only=True)
class GainCondition:
    """Weights that prove the decay of V.

    Attributes:
        weights: w. Length n.
        decay: μ, 1/s.
        spare: By how much more V would decay, 1/s, to a part in 1024 of μ; negative where the condition does not hold.
        margins: How much decay each row could lose, 1/s, to the same part. Length n; empty where it does not hold.
    """

    weights: tuple[float, ...]
    decay: float
    spare: float
    margins: tuple[float, ...]

    @property
    def holds(self) -> bool:
        """Whether V decays at the rate μ outside its ultimate level."""
        return self.spare >= 0


def gain_condition(found: Composition) -> GainCondition:
    """Decide the condition of a composition that was found."""
    count, decay = len(found.weights), Fraction(found.decay)
    weights = tuple(float(w) for w in found.weights)
    if not _holds(found, [decay] * count):
        return GainCondition(weights=weights, decay=found.decay, spare=-found.decay, margins=())

    def most(rows: list[int]) -> float:
        low, high = Fraction(0), decay
        for _ in range(STEPS):
            trial = (low + high) / 2
            good = _holds(found, [decay + trial * (i in rows) for i in range(count)])
            low, high = (trial, high) if good else (low, trial)
        return float(low)

    everything = list(range(count))
    return GainCondition(
        weights=weights, decay=found.decay, spare=most(everything), margins=tuple(most([i]) for i in everything)
    )


def _holds(found: Composition, decays: list[Fraction]) -> bool:
    """P positive definite at every vertex, with a rate for each row; θ̂ in V only where its gain keeps its sign."""
    rows, n = found.rows, len(decays)
    w, young, leak = ([Fraction(float(v)) for v in part] for part in (found.weights, found.young, found.leak))
    if min(w) <= 0 or min(young) <= 0 or min(leak) < 0:
        return False
    if any(p > 0 and not rows.control_gain[i] > 0 for i, p in enumerate(leak)):
        return False
    middle, radius = ([[Fraction(0)] * n for _ in range(n)] for _ in range(2))
    for i in range(n):
        adapted = Fraction(float(rows.control_gain[i])) * w[i] * leak[i] / 2 if leak[i] > 0 else Fraction(0)
        lost = w[i] * young[i] / 2 + decays[i] / 2 * w[i] * Fraction(float(rows.mass_high[i]))
        middle[i][i] = -w[i] * Fraction(float(rows.high[i, i])) + adapted - lost
        for j in range(i):
            ends = (rows.low, rows.high)
            low, high = (w[i] * Fraction(float(s[i, j])) + w[j] * Fraction(float(s[j, i])) for s in ends)
            middle[i][j] = middle[j][i] = -(low + high) / 4
            radius[i][j] = radius[j][i] = (high - low) / 4
    for signs in product((1, -1), repeat=n - 1):
        z = (1, *signs)
        if not positive_definite([[middle[i][j] - z[i] * z[j] * radius[i][j] for j in range(n)] for i in range(n)]):
            return False
    return True
