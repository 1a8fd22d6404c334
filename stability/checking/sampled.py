"""The sampled certificate: a comparison system on the exact zero-order-hold map.

Theorem: A R + b <= R is never left, A s <= (1 - mu T) s tells how fast R is reached (Bellman 1962; Siljak 1978).
Obligations: contraction, invariance, sampling, accuracy. Must fail: smaller reach, start or shape, a faster decay.
"""

from __future__ import annotations

from fractions import Fraction
from itertools import product

from .arithmetic import WORK, exponential, up
from .claim import Claim
from .deviation import Deviation
from .period import Period

#: What a cell costs for each of its vertices and a power of its rows, in products.
CELL_COST = 10


class Held:
    """Verdicts of a sampled certificate: each cell of the inertias' ranges by itself."""

    def __init__(self, claim: Claim, loop: Deviation) -> None:
        self.claim = claim
        size, uncertain = len(loop.mass), sum(low < high for low, high in loop.mass)
        WORK.one(CELL_COST * len(claim.cells) * (2**uncertain + 8) * size**3)
        cuts = []
        for (low, high), count in zip(loop.mass, claim.split, strict=True):
            width = (high - low) / max(count, 1)
            cuts.append([(low + k * width, low + (k + 1) * width) for k in range(count)])
        parts = zip(claim.cells, product(*cuts), strict=True)
        self.periods = [Period(claim, loop, cell, list(masses)) for cell, masses in parts]

    def contracts(self) -> bool:
        """A s <= (1 - μT) s at every vertex."""
        return self.contraction()[2] >= 0

    def contraction(self) -> tuple[str, str, Fraction]:
        """By how much μ could grow; fails where s does not cover P - R."""
        claim, margins = self.claim, []
        for period in self.periods:
            cell = period.cell
            shrunk = period.image(cell.shape, push=False)
            spare = (1 - max(v / s for v, s in zip(shrunk, cell.shape, strict=True))) / claim.period - claim.decay
            covered = all(s >= p - r for s, p, r in zip(cell.shape, cell.start, cell.reach, strict=True))
            margins.append(spare if covered else -claim.decay)
        statement = f"A s <= (1 - mu T) s at every vertex, mu = {float(claim.decay):.4g} 1/s"
        return "contraction", statement, min(margins)

    def invariance(self) -> Fraction:
        """Between samples too, deviations and held inputs stay inside the box in which the model was bounded."""
        return 1 - max(max(p.states(p.cell.start) + p.inputs(p.cell.start)) for p in self.periods)

    def sampling(self) -> tuple[str, Fraction]:
        """A R + b < R and max(A P + b, |y(0)|) < P: neither set is left."""
        spare = []
        for period in self.periods:
            cell = period.cell
            begun = map(max, period.image(cell.start), period.initial())
            pairs = [*zip(period.image(cell.reach), cell.reach, strict=True), *zip(begun, cell.start, strict=True)]
            spare += [1 - v / r for v, r in pairs]
        return "the exact zero-order-hold map keeps the comparison bounds", min(spare)

    def ultimate(self, i: int) -> Fraction:
        """Bound on |z_i| from the end of the transient on."""
        claim, found = self.claim, []
        time = max(Fraction(0), min(claim.decay * (claim.transient - claim.period), Fraction(100)))
        left = exponential(-time)[1]
        for period in self.periods:
            cell = period.cell
            late = [min(r + s * left, p) for r, s, p in zip(cell.reach, cell.shape, cell.start, strict=True)]
            found.append(period.states(late)[i])
        return min(up(max(found) * claim.half_widths[i]), claim.half_widths[i])
