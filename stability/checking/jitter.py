"""An input that acts earlier or later than it should.

Theorem: while another input acts than the nominal one, for a time of at most the jitter, z' differs by b times the
change of the input and by what the uncertainty makes of that; so z is kicked by at most an integral of e^{|a| s}.
Must fail: a larger jitter, one that is longer than the delay.
"""

from __future__ import annotations

from collections.abc import Sequence
from fractions import Fraction
from typing import Any

from .arithmetic import up
from .limits import FIXED, NotProvedError
from .matrices import Matrix, dot, exponential_of, identity, inverse_of


class Jitter:
    """For a change of 1 of each input: kicks to z, and |z'| meanwhile; what a kick makes of z until it is over.

    `changed` is the part of a change that the modelling terms make. Everything is in units of the box.
    """

    def __init__(self, turn: Any) -> None:
        claim, n = turn.claim, turn.n
        late, size = claim.jitter / claim.period, [[abs(v) for v in row] for row in turn.a]
        block = [[late * v for v in (*row, *unit)] for row, unit in zip(size, identity(n), strict=True)]
        forward = exponential_of([*block, *[[Fraction(0)] * (2 * n)] * n]).part(slice(0, n), slice(None))
        grown = [[up(Fraction(v, 1 << FIXED)) for v in row] for row in forward.sizes()]
        self.grown, area = [row[:n] for row in grown], [row[n:] for row in grown]
        more = turn.more
        worse = [[turn.change[i] * size[i][j] + more[i] * turn.a_spread[i][j] for j in range(n)] for i in range(n)]
        for place, i, share in turn.lags.followed:
            for row, own, spread in zip(worse, more, turn.a_spread, strict=True):
                row[place] += share * own * spread[i]
        driven = [[more[i] * (abs(v) + w) for v, w in zip(turn.b[i], turn.b_spread[i], strict=True)] for i in range(n)]
        grows = inverse_of(_combined(identity(n), _times(area, worse), -1))
        if min(v for row in grows for v in row) < 0:  # not the sum of a series
            raise NotProvedError("the uncertainty is too large for this jitter")
        self.kicks = [[up(v) for v in row] for row in _times(grows, _times(area, driven))]
        self.sudden = _combined(driven, _times(_combined(size, worse, 1), self.kicks), 1)
        sizes = zip(range(turn.m), claim.input_bound, strict=True)
        self.changed = [up(claim.period * turn.loop.drift(k) / bound) for k, bound in sizes]


def _times(left: Matrix, right: Matrix) -> Matrix:
    columns = list(zip(*right, strict=True))
    return [[dot(row, column) for column in columns] for row in left]


def _combined(left: Sequence[Sequence[Fraction]], right: Matrix, sign: int) -> Matrix:
    return [[a + sign * b for a, b in zip(*rows, strict=True)] for rows in zip(left, right, strict=True)]
