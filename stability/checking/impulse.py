"""The impulse-response certificate.

Theorem: sup y <= y0 + Λ S sup y with Λ S s < s for some s > 0 gives sup y <= (I - Λ S)^-1 y0 (Khammash and Pearson
1991; Dahleh and Diaz-Bobillo 1995, ch. 7). Obligations: contraction, small gain, invariance, accuracy. Must fail: a
smaller box, less of what acts, a faster decay.
"""

from __future__ import annotations

from dataclasses import replace
from fractions import Fraction
from itertools import pairwise, product

from .arithmetic import WORK, Interval, down, root, up
from .claim import Cell, Claim
from .limits import FIXED, ROUNDING, NotProvedError
from .loop import Loop
from .matrices import Matrix, Whole, dot
from .responses import PARTS, Responses
from .turn import PHASES, Turn

#: What a guess is made for is enlarged by this share, so that the exact inequality is strict.
ROOM = Fraction(1, 1 << 30)


class Bounded:
    """One cell: what y = (z, s, v, c, w, an observer's) reaches, and how fast what a start makes of it shrinks."""

    def __init__(self, turn: Turn, cell: Cell) -> None:
        self.turn, self.cell = turn, cell
        found = Responses(turn, cell)
        self.spare = found.spare
        plain, weighted = ([_fractions(part) for part in sums] for sums in found.sums)
        self.reads, pulses = self._reads()
        n, m = turn.n, turn.m
        self.gain = [self._gain(sums) for sums in (plain, weighted)]
        forced = [dot(row[:n], turn.push) + dot(row[n:], turn.moving) for row in plain[0]]
        forced = [v + dot(row, [*pulses, *turn.noise]) for v, row in zip(forced, plain[1], strict=True)]
        first = [*turn.started()[0], Fraction(1)]
        begun = [[dot(row, first) for row in sums[2]] for sums in (plain, weighted)]
        whole = bounded(self.gain[0], [a + b for a, b in zip(forced, begun[0], strict=True)])
        acted = [dot(row, whole) + push for row, push in zip(self.reads[:n], turn.push, strict=True)]
        moved = [dot(row[n:], turn.moving) for row in turn.sources[:n]]
        rates = [up(s + r + p) for s, r, p in zip(whole[n : 2 * n], acted, moved, strict=True)]
        if turn.jitter:
            changes = [v + w for v, w in zip(whole[-m:], turn.jitter.changed, strict=True)]
            rates = [up(v + dot(row, changes)) for v, row in zip(rates, turn.jitter.sudden, strict=True)]
        self.rates = self._joined(rates)[: len(turn.claim.rows)]
        self.forced = self._read(bounded(self.gain[0], forced))
        self.whole, self.amplitude = self._read(whole), self._read(bounded(self.gain[1], begun[1]))
        n = len(turn.claim.rows)
        self.inputs = [v + late for v, late in zip(self.whole[2 * n : 2 * n + m], turn.late, strict=True)]
        after = 2 * n + m + turn.q
        self.missed = self.whole[2 * n + m : after]
        after += turn.filters
        self.missed += self.whole[after : after + len(turn.shown)]

    def _joined(self, reached: list[Fraction]) -> list[Fraction]:
        """Bounds with z as it is, of bounds on y or on rates."""
        found = list(reached)
        for place, i, share in self.turn.lags.followed:
            found[i] = up(found[i] + share * reached[place])
        return found

    def _read(self, reached: list[Fraction]) -> list[Fraction]:
        """Bounds on y with z as it is, and without what only lags have."""
        n, whole, found = len(self.turn.claim.rows), self.turn.n, self._joined(reached)
        return [*found[:n], *found[whole : whole + n], *found[2 * whole :]]

    def _reads(self) -> tuple[Matrix, list[Fraction]]:
        """S: |ρ| and the pulses on inputs, networks, leads and an observer over y; and what of them is known."""
        turn, n, m, q = self.turn, self.turn.n, self.turn.m, self.turn.q
        rest = [Fraction(0)] * (len(turn.shown) + turn.turns)
        kicks, changed = (turn.jitter.kicks, turn.jitter.changed) if turn.jitter else ([], [])
        nothing = [Fraction(0)] * (q + turn.filters) + rest
        reads = []
        for i in range(n):
            more = turn.more[i]
            row = [more * v for v in turn.a_spread[i]]
            row += [turn.change[i] * int(i == j) for j in range(n)]
            reads.append([*row, *(more * v for v in turn.b_spread[i]), *nothing])
        known = list(turn.blur) + [Fraction(0)] * (q + turn.filters + turn.w) + [dot(row, changed) for row in kicks]
        errors = [size / r for size, r in zip(turn.claim.measured, turn.claim.half_widths, strict=True)]
        errors += [Fraction(0)] * len(turn.claim.lags)
        for k, row in enumerate([*turn.act_spread, *turn.learn_spread, *turn.smooth_spread]):
            reads.append([*row[:n], *[Fraction(0)] * (n + m), *row[n:], *rest])
            known[k] += dot(row[:n], errors)
        ahead = [Fraction(0)] * (len(reads[0]) - turn.turns)
        for gain in turn.blind:
            reads.append([*ahead[:-1], gain, *[Fraction(0)] * turn.turns])
        reads += [[*ahead, *row] for row in kicks]
        for row in reads:
            for place, i, share in turn.lags.followed:
                row[place] += share * row[i]
        return [[up(v) for v in row] for row in reads], [up(v) for v in known]

    def _gain(self, sums: list[Matrix]) -> Matrix:
        """Λ S."""
        n, count = self.turn.n, self.turn.width - self.turn.n
        columns = list(zip(*self.reads, strict=True))
        return [
            [up(dot([*rest[:n], *pulses[:count]], column)) for column in columns]
            for rest, pulses in zip(sums[0], sums[1], strict=True)
        ]

    def contracts(self) -> Fraction:
        """1 - max (Λ S s)_i / s_i for an s > 0 in which the gain is small, of both sums."""
        return min(1 - max(dot(row, s) / own for row, own in zip(gain, s, strict=True)) for gain in self.gain
                   for s in [bounded(gain, [Fraction(1)] * len(gain))])  # fmt: skip


def _fractions(part: Whole) -> Matrix:
    return [[up(Fraction(v, 1 << FIXED)) for v in row] for row in part]


def bounded(gain: Matrix, known: list[Fraction]) -> list[Fraction]:
    """Y > 0 with known + gain y < y: nothing larger satisfies y <= known + gain y. The guess is of floats."""
    count, room = len(known), ROOM * (max(known) or 1)
    known = [k + room for k in known]
    if max(*known, *(v for row in gain for v in row)) > MOST:
        raise NotProvedError("the uncertainty is too large for this loop: its gain is not small")
    work = [[float(int(i == j) - v) for j, v in enumerate(row)] + [float(k)] for i, (row, k) in
            enumerate(zip(gain, known, strict=True))]  # fmt: skip
    for i in range(count):
        pivot = max(range(i, count), key=lambda k: abs(work[k][i]))
        work[i], work[pivot] = work[pivot], work[i]
        if not abs(work[i][i]) > 0:
            break
        work[i] = [v / work[i][i] for v in work[i]]
        for k in range(count):
            if k != i:
                factor = work[k][i]
                work[k] = [a - factor * b for a, b in zip(work[k], work[i], strict=True)]
    if all(0 < row[-1] < 1e300 for row in work):
        guess = [up(Fraction(row[-1])) for row in work]
        if all(k - room + dot(row, guess) < own for row, own, k in zip(gain, guess, known, strict=True)):
            return guess
    raise NotProvedError("the uncertainty is too large for this loop: its gain is not small")


class Impulse:
    """Verdicts on a member: each cell of the ranges by itself."""

    def __init__(self, claim: Claim, loop: Loop) -> None:
        self.claim, self.loop = claim, loop
        for cell in claim.cells:
            rows, substeps = (PHASES + 1) * (2 * len(claim.rows) + 1), PARTS * len(cell.groups)
            order = len(cell.columns)
            WORK.one(
                (rows * substeps * order * (len(claim.rows) + 1) + 8 * max(cell.groups) * order + 20 * order**3) // COST
            )
        pieces = self._pieces()
        # what φ* and b* are is told by middles of ranges: in every piece they are others
        self.loops = [own for _, own in pieces]
        parts = [
            (part, own, list(masses))
            for part, own in pieces
            for masses in product(*map(parts_of, own.mass, claim.split))
        ]
        cells = zip(claim.cells, parts, strict=True)
        self.cells = [Bounded(Turn(part, own, cell, masses), cell) for cell, (part, own, masses) in cells]
        self.later: dict[int, list[Fraction]] = {}

    def _pieces(self) -> list[tuple[Claim, Loop]]:
        """The statement with every combination of parts of the constants that are cut, the last one running fastest."""
        claim = self.claim
        if not claim.parts:
            return [(claim, self.loop)]
        cuts = [parts_of(claim.parameters[name], count) for name, count in claim.parts.items()]
        chosen = [dict(zip(claim.parts, ranges, strict=True)) for ranges in product(*cuts)]
        pieces = [replace(claim, parameters={**claim.parameters, **part}) for part in chosen]
        return [(piece, Loop(piece, ROUNDING)) for piece in pieces]

    def contraction(self) -> Fraction:
        """How far the slowest cell is from not contracting, with the weight of its transient."""
        return min(cell.spare for cell in self.cells)

    def small_gain(self) -> Fraction:
        """1 less the gain of what is uncertain."""
        return min(cell.contracts() for cell in self.cells)

    def invariance(self) -> Fraction:
        """Deviations, inputs, networks and demands stay inside the box in which the model was bounded."""
        claim, spare = self.claim, []
        for cell in self.cells:
            spare += [1 - v for v in (*cell.whole[: len(claim.rows)], *cell.inputs, *cell.missed)]
        for loop in (self.loop, *self.loops):
            for found, taken in zip(loop.demand, claim.demand, strict=True):
                size = max(abs(end) for end in taken) or Fraction(1)
                spare += [(found[0] - taken[0]) / size, (taken[1] - found[1]) / size]
        return min(spare)

    def estimates(self) -> list[Fraction]:
        """Bounds on |φ̂| of the rows with a network."""
        pairs = zip(self.claim.demand, self.claim.network_bound, strict=True)
        return [max(abs(low), abs(high)) + bound for (low, high), bound in pairs]

    def _after(self, time: Fraction) -> list[Fraction]:
        """Bounds on y from a time on, in units of the box."""
        periods = int(time / self.claim.period)
        if periods not in self.later:
            found = []
            for cell in self.cells:
                left = 1 / _power(cell.cell.growth, periods)
                parts = zip(cell.forced, cell.amplitude, cell.whole, strict=True)
                found.append([min(forced + left * start, whole) for forced, start, whole in parts])
            self.later[periods] = [max(column) for column in zip(*found, strict=True)]
        return self.later[periods]

    def sizes(self, time: Fraction) -> list[Fraction]:
        """Bounds on |z| and on |v|, as commanded, from a time on."""
        claim, after, n, m = self.claim, self._after(time), len(self.claim.rows), len(self.claim.inputs)
        late = [max(cell.turn.late[k] for cell in self.cells) for k in range(m)]
        moved = [*after[:n], *(v + w for v, w in zip(after[2 * n : 2 * n + m], late, strict=True))]
        whole = [*claim.half_widths, *claim.input_bound]
        return [min(up(v * r), r) for v, r in zip(moved, whole, strict=True)]

    def ultimate(self, i: int) -> Fraction:
        """Bound on |z_i| from the end of the transient on."""
        return self.sizes(self.claim.transient)[i]

    def largest(self, name: str) -> Fraction:
        """Bound on |input| as commanded, or on |state|: the start while the reference rests, what is left in motion."""
        claim = self.claim
        whole = [*claim.half_widths, *claim.input_bound]
        if not claim.rest[1] > 0:
            return max(loop.size(name, whole, resting=False) for loop in self.loops)
        moving = self.sizes(claim.rest[1])
        sizes = [(loop.size(name, moving, resting=False), loop.size(name, whole, resting=True)) for loop in self.loops]
        return max(max(pair) for pair in sizes)

    def norm(self, signals: list[str]) -> Fraction:
        """Bound on the norm of inputs as commanded, or of states."""
        return root(up(sum((self.largest(s) ** 2 for s in signals), Fraction(0))), True)

    def speed(self, i: int) -> Fraction:
        """Bound on |z_i'| for all t."""
        return up(max(cell.rates[i] for cell in self.cells) * self.claim.half_widths[i] / self.claim.period)

    def rate(self) -> Fraction:
        """A bound from below on the rate at which what a start makes shrinks, 1/s: ln g >= 2 (g - 1)/(g + 1)."""
        least = min(cell.cell.growth for cell in self.cells)
        return 2 * (least - 1) / (least + 1) / self.claim.period


def parts_of(whole: Interval, count: int) -> list[Interval]:
    """A range in parts that cover it: of about equal ratios where it is positive, of equal widths elsewhere."""
    low, high = whole
    if low > 0:
        ratio = float(high / low)
        cuts = [down(low * Fraction(ratio ** (k / count))) for k in range(1, count)]
    else:
        cuts = [down(low + (high - low) * k / count) for k in range(1, count)]
    return list(pairwise([low, *(min(max(cut, low), high) for cut in cuts), high]))


#: A power that is larger than this counts as this.
MOST = Fraction(1 << 256)
#: What a product of a summation costs, in products of intervals.
COST = 40


def _power(base: Fraction, exponent: int) -> Fraction:
    """base^exponent for base >= 1, rounded down."""
    found, bits = Fraction(1), FIXED
    for bit in bin(exponent)[2:]:
        found = found * found * (base if bit == "1" else 1)
        found = min(Fraction((found.numerator << bits) // found.denominator, 1 << bits), MOST)
    return found
