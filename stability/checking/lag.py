"""Rows that only follow what is commanded, with a time constant that is not known exactly.

Theorem: with M = M0/(1 + δ), δ constant, z' = (1 + δ) s + ..., and e = δ ζ, ζ' = a ζ + s, the rest z - e obeys the
row without δ s (docs/proof.md). Must fail: a row that reads anything else, that is measured, that does not contract.
"""

from __future__ import annotations

from fractions import Fraction
from typing import Any

from .arithmetic import ZERO, Interval, up
from .limits import need


class Lags:
    """Gives a turn another state ζ for each lag: δ s_i acts as δ ζ would, added to z_i wherever that is read.

    `followed` holds the place of each ζ among the states, the row that it follows, and the largest |δ| of that.
    """

    def __init__(self, turn: Any) -> None:
        claim = turn.claim
        self.rows, self.plain, count = claim.lags, len(claim.rows), len(claim.lags)
        n, none = self.plain, [Fraction(0)] * count
        turn.more = [1 + v for v in turn.change] + [Fraction(1)] * count
        self.followed = [(n + k, i, turn.change[i]) for k, i in enumerate(claim.lags)]
        for rows in (turn.a, turn.a_spread):
            rows[:] = [[*row, *none] for row in rows]
        for place, i, share in self.followed:
            alone = all(turn.loop.entry(i, j) == ZERO and turn.a[i][j] == 0 for j in range(n) if j != i)
            need(alone and turn.a[i][i] < 0, "a lag reads nothing but what it follows")
            for j in range(n):
                turn.a_spread[j][place] += up(abs(turn.a[j][i]) * share) if j != i else 0
            own = [*turn.a[i][:n], *none]
            own[place] = turn.a[i][i]
            turn.a.append(own)
            turn.a_spread.append([Fraction(0)] * (n + count))
            turn.a_spread[-1][place] = up(abs(turn.a[i][i]) * share)
            turn.b.append(list(turn.b[i]))
            turn.b_spread.append([Fraction(0)] * turn.m)
        for i in claim.lags:
            turn.change[i] = Fraction(0)
        turn.change += none
        turn.push += none

    def unread(self, rows: list[list[Interval]]) -> None:
        """Refuse a controller that reads a lag."""
        need(all(row[i] == ZERO for row in rows for i in self.rows), "a lag is not measured")

    def spaced(self, row: list[Interval]) -> list[Interval]:
        """A row over (z, …) with a place for the states of lags after z."""
        return [*row[: self.plain], *[ZERO] * len(self.rows), *row[self.plain :]]
