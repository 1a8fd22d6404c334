"""L1 norms of the impulse responses of a sampled loop.

Theorem: Khammash and Pearson (1991); Bamieh, Dahleh and Pearson (1993) for a kernel of two times; docs/proof.md for
the sums. Must fail: coordinates in which a period does not contract, fewer periods, a smaller weight.
"""

from __future__ import annotations

from fractions import Fraction
from itertools import pairwise

from .claim import Cell
from .limits import FIXED, NotProvedError, need
from .matrices import Ball, Whole, ball, eye, inverse_of, nothing, times_up
from .sums import WHOLE, Piece, Weighted, added, larger, length_of, norm_of, scaled_up, through, times_ratio
from .turn import Turn

#: Sub-steps of a period for sources.
PARTS = 3
#: Grid of the coordinates of a file.
SHORTER = 1 << 48
#: Bits that norms are rounded up by, to keep exact inverses short.
SHORT = FIXED - 64


class Responses:
    """The norms of a loop, plain and weighted; the columns of `rest` are over ρ and the rates of the demands."""

    def __init__(self, turn: Turn, cell: Cell) -> None:
        need(len(cell.columns) == turn.order, f"the loop has {turn.order} states with all that it remembers")
        self.turn, self.cell = turn, cell
        self.pieces: dict[Fraction, Piece] = {}
        self._coordinates()
        self._instants()
        self._groups()

    def _piece(self, length: Fraction) -> Piece:
        if length not in self.pieces:
            self.pieces[length] = Piece(self.turn, length)
        return self.pieces[length]

    def _coordinates(self) -> None:
        """Λ, the blocks of V^-1 F V; N, bounds on the norms of all its blocks; and what Λ leaves out."""
        turn, cell = self.turn, self.cell
        # any coordinates will do: short ones have an inverse that is soon found
        rounded = [[Fraction(round(v * SHORTER), SHORTER) for v in row] for row in cell.columns]
        self.back, columns = ball(inverse_of(rounded)), ball(rounded)
        self.columns = columns
        order = turn.order
        inside = self.back @ turn.image.part(slice(0, order), slice(0, order)) @ columns
        self.ends = [sum(cell.blocks[:k]) for k in range(len(cell.blocks) + 1)]
        self.diagonal = []
        count = len(cell.blocks)
        self.norms, self.missed = ([[0] * count for _ in range(count)] for _ in range(2))
        for i in range(count):
            for j in range(count):
                part = inside.part(slice(*self.ends[i : i + 2]), slice(*self.ends[j : j + 2]))
                room = 2 * inside.error
                if i == j:
                    self.diagonal.append(part.rows)
                    self.norms[i][i], self.missed[i][i] = norm_of(part.rows) + room, room
                else:
                    self.norms[i][j] = self.missed[i][j] = length_of([v for row in part.rows for v in row]) + room
        self.norms = [[-(-v >> SHORT) << SHORT for v in row] for row in self.norms]
        ways = [self._reach(Fraction(1)), self._reach(cell.growth)]
        self.reach = [way[0] for way in ways]
        self.astray = [way[1] for way in ways]
        # with d = (I - g N)^-1 1 it is g N d = d - 1
        self.spare = min(Fraction(WHOLE, sum(row)) for row in self.reach[1])

    def _reach(self, growth: Fraction) -> tuple[Whole, Whole]:
        """(I - g N)^-1, and (I - g N)^-1 g E (I - g N)^-1 with E for what Λ leaves out."""
        count = len(self.norms)
        grown = [[-growth * Fraction(v, WHOLE) + int(i == j) for j, v in enumerate(row)]
                 for i, row in enumerate(self.norms)]  # fmt: skip
        found = inverse_of(grown)
        # a matrix that is not negative has a spectral radius below 1 where I - N has an inverse that is not negative
        if min(v for row in found for v in row) < 0 or not all(grown[i][i] > 0 for i in range(count)):
            raise NotProvedError("the loop does not contract in the coordinates of its certificate")
        reach = [[scaled_up(WHOLE, v) for v in row] for row in found]
        missed = times_ratio(self.missed, growth.numerator, growth.denominator)
        return reach, times_up(times_up(reach, missed), reach)

    def _instants(self) -> None:
        """Rows of the outputs (z, s, v) at both ends of every sub-step, each once; of c, w and an observer's."""
        turn, n, m, q = self.turn, self.turn.n, self.turn.m, self.turn.q
        flow = ball([[*row] for row in turn.flow[:n]])
        direct = ball([[Fraction(0)] * n + row for row in turn.direct])
        self.outputs = 2 * n + m
        self.cx = Ball([*eye(n + q).rows[:n], *flow.rows, *direct.rows], 1)
        entry = Ball([*nothing(n, m).rows, *ball(turn.b).rows, *eye(m).rows], 1)
        made: list[Ball] = []
        index: dict[tuple[int, int], int] = {}
        self.pairs: list[tuple[int, int]] = []
        for begin, end, acting in turn.ends:
            ends = []
            for x in (begin, end):
                key = (id(x), id(acting))
                if key not in index:
                    index[key] = len(made)
                    made.append(self.cx @ x + entry @ acting)
                ends.append(index[key])
            self.pairs.append((ends[0], ends[1]))
        rows = [row for part in made for row in part.rows]
        self.count = len(rows)
        places = [*range(n, n + q), *range(turn.first - turn.filters, turn.first)]
        remembered = [[Fraction(int(c == place)) for c in range(turn.columns)] for place in places]
        chosen = ball([*remembered, *turn.shown, *turn.turned()])
        self.rows = Ball([*rows, *chosen.rows], max(chosen.error, *(part.error for part in made)))

    def _groups(self) -> None:
        """Everything that acts in earlier periods, group by group; then the tail, and the period of the output."""
        turn, cell, order = self.turn, self.cell, self.turn.order
        fold, start = self.back @ turn.fold, self.back @ turn.begin
        acting = self.back @ turn.image.part(slice(0, order), slice(order, None))
        grid = _Grid(self, self._piece(Fraction(1, PARTS)), fold)
        apart, start_apart = self.across(self.stepped(acting)), self.across(self.stepped(start))
        row = self.rows.part(slice(None), slice(0, order)) @ self.columns
        blocks, count, first = self._powers(max(cell.groups)), len(row.rows), self.lengths(row)
        rest, felt, begun = (Weighted(count, width) for width in (len(turn.sources), turn.width, len(start.rows[0])))
        weight, weights = WHOLE, self._weights(max(cell.groups))
        for p in cell.groups:
            sizes, (power, total) = self.lengths(row), blocks[p]
            summed = through(row, total, self.ends)
            weight = (weight * weights[p] >> FIXED) + 1
            rest.add(grid.integrals(row, summed, sizes, p), weight)
            direct, largest = (summed @ acting).sizes(), (row @ start).sizes()
            if p > 1:
                direct = larger(direct, times_ratio(times_up(sizes, apart), p * (p - 1), 2))
                largest = added(largest, times_ratio(times_up(sizes, start_apart), p - 1))
            felt.add(direct, weight)
            begun.keep(largest, scaled_up(weight, 1 / cell.growth))
            row = through(row, power, self.ends)
        last = self.lengths(row)
        now, given = self._current(), self._given()
        (area, held), entry = grid.tail(), self.across(acting)
        unsure = [[scaled_up(WHOLE, v)] for v in turn.started()[1]]
        unknown = self.bounded(times_up(self.back.sizes(), unsure))
        self.sums = []
        for k, growth in enumerate((Fraction(1), cell.growth)):
            strayed = times_up(first, self.astray[k])
            final = added(times_ratio(last, weight, WHOLE) if k else last, strayed)
            tail = times_ratio(times_up(final, self.reach[k]), growth.numerator, growth.denominator)
            off = times_ratio(strayed, growth.numerator, growth.denominator)
            whole = added(rest.sums[k], now, times_up(tail, area), times_up(off, held))
            acted = added(felt.sums[k], given, times_up(tail, entry), times_up(off, entry))
            settling = self._settling(self.across(start), k)
            known = larger(added(begun.sums[k], times_up(off, self.across(start))), times_up(final, settling))
            more = times_up(first, self._settling(unknown, k))
            found = self._between(acted)
            # a kick may be over after the next sample, or begin before the one that it is counted after
            for row in found if turn.kicked else []:
                for j in range(turn.n):
                    row[turn.width - 2 * turn.n + j] += scaled_up(row[turn.width - turn.n + j], growth)
            self.sums.append((self._between(whole, own=True), found,
                              self._between([[*x, *y] for x, y in zip(known, more, strict=True)])))  # fmt: skip

    def _settling(self, entry: Whole, k: int) -> Whole:
        """D with x <= d and g N d <= d: bounds g^j N^j x for all j."""
        growth = self.cell.growth if k else Fraction(1)
        grown = times_ratio(self.norms, growth.numerator, growth.denominator)
        ahead = [
            [max(a - b, 0) for a, b in zip(x, y, strict=True)]
            for x, y in zip(times_up(grown, entry), entry, strict=True)
        ]
        return added(entry, times_up(self.reach[k], ahead))

    def _powers(self, largest: int) -> dict[int, tuple[list[Ball], list[Ball]]]:
        """Λ^p and 1 + Λ + … + Λ^(p-1) for every size of a group."""
        wanted, found = set(self.cell.groups), {}
        power = [eye(len(block)) for block in self.diagonal]
        total = [nothing(len(block), len(block)) for block in self.diagonal]
        blocks = [Ball(block, 0) for block in self.diagonal]
        for p in range(1, largest + 1):
            total = [t + w for t, w in zip(total, power, strict=True)]
            power = [w @ b for w, b in zip(power, blocks, strict=True)]
            if p in wanted:
                found[p] = power, total
        return found

    def _weights(self, largest: int) -> list[int]:
        """growth^p, rounded up."""
        growth, found = scaled_up(WHOLE, self.cell.growth), [WHOLE]
        for _ in range(largest):
            found.append((found[-1] * growth >> FIXED) + 1)
            if found[-1] >> 2 * FIXED:
                raise NotProvedError("the weight of the transient is too large for these periods")
        return found

    def lengths(self, rows: Ball) -> Whole:
        """Norms by block of rows over y."""
        ends, error = self.ends, 2 * rows.error
        return [[length_of(row[a:b]) + error for a, b in pairwise(ends)] for row in rows.rows]

    def across(self, columns: Ball) -> Whole:
        """Norms by block of columns over y."""
        return self.bounded(columns.sizes())

    def bounded(self, sizes: Whole) -> Whole:
        """The same of bounds on their entries."""
        ends = self.ends
        return [[length_of([row[c] for row in sizes[a:b]]) for c in range(len(sizes[0]))]
                for a, b in pairwise(ends)]  # fmt: skip

    def stepped(self, columns: Ball) -> Ball:
        """(Λ - 1) times columns."""
        rows, error = [], 0
        for block, first in zip(self.diagonal, self.ends, strict=False):
            part = Ball(block, 0) @ columns.part(slice(first, first + len(block)), slice(None))
            rows, error = [*rows, *part.rows], max(error, part.error)
        return Ball(rows, error) - columns

    def _given(self) -> Whole:
        """What acts on the outputs at once; while jitter decides which input acts, z is otherwise by a kick at most."""
        turn, n, size = self.turn, self.turn.n, self.outputs
        found = self.rows.part(slice(None), slice(turn.order, None)).sizes()
        place = turn.width - n - turn.kicked
        for r in range(self.count if turn.kicked else 0):
            if r % size < n:
                for j, value in enumerate(turn.jitter.grown[r % size] if turn.jitter else []):
                    found[r][place + j] += scaled_up(WHOLE, value)
        return found

    def _current(self) -> Whole:
        """What acts in the period of the output, before it."""
        turn, size = self.turn, self.outputs
        pieces = [self._piece(h) for h in turn.steps]
        found = [[0] * len(turn.sources) for _ in self.rows.rows]
        written: set[int] = set()
        for j in range(len(turn.steps)):
            rows, total = self.cx, [[0] * len(turn.sources) for _ in range(size)]
            for i in range(j, -1, -1):
                total = added(total, pieces[i].integral(rows))
                rows = rows @ pieces[i].forward
            ends = [self.pairs[j][1]] + ([self.pairs[j + 1][0]] if j + 1 < len(turn.steps) else [])
            for place in ends:
                if place not in written:
                    written.add(place)
                    found[place * size : (place + 1) * size] = total
        # what the demands move while the input before still acts
        late = turn.claim.jitter / turn.claim.period
        for r in range(self.count if turn.kicked else 0):
            for j in range(turn.q if r % size >= 2 * turn.n else 0):
                found[r][turn.n + j] += scaled_up(WHOLE, late * turn.direct[r % size - 2 * turn.n][j])
        return found

    def _between(self, values: Whole, *, own: bool = False) -> Whole:
        """The largest over all phases, from both ends of each sub-step, with h²/8 of the curvature between them."""
        turn, n, q, size = self.turn, self.turn.n, self.turn.q, self.outputs
        width = len(values[0])
        best = [[0] * width for _ in range(size)]
        bend = (self.cx @ ball(turn.flow)).sizes()
        for (early, late), h in zip(self.pairs, turn.steps, strict=True):
            a, b = (values[place * size : (place + 1) * size] for place in (early, late))
            speed = [*a[n : 2 * n], *[[0] * width for _ in range(q)]]
            speed = added(speed, ball(turn.sources).sizes()) if own else speed
            curved = times_up(times_up(bend, self._piece(h).ceiling), speed)
            square = scaled_up(WHOLE, h * h / 8)
            more = [[(v * square >> FIXED) + 1 for v in row] for row in curved]
            best = larger(best, added(larger(a, b), more))
        return [*best, *values[self.count :]]


class _Grid:
    """Sub-steps of a period for sources, in coordinates y."""

    def __init__(self, responses: Responses, piece: Piece, fold: Ball) -> None:
        self.responses, self.piece = responses, piece
        self.parts: list[tuple[Ball, Ball, Whole]] = []
        for _ in range(PARTS):
            self.parts.append((fold, fold @ piece.area, responses.across(responses.stepped(fold))))
            fold = fold @ piece.forward

    def tail(self) -> tuple[Whole, Whole]:
        """Bounds by block on the integrals over a period of all that acts, with its signs and without."""
        bounded, areas, sizes = self.responses.bounded, [], []
        for inward, area, _ in self.parts:
            within = inward.sizes()
            areas.append(larger(self.responses.across(area), bounded(times_up(within, self.piece.slope))))
            sizes.append(bounded(times_up(within, self.piece.size)))
        return added(*areas), added(*sizes)

    def integrals(self, row: Ball, summed: Ball, sizes: Whole, p: int) -> Whole:
        """Bounds on the integrals of a group of p periods, over a period."""
        total: Whole = []
        for inward, area, apart in self.parts:
            here = (row @ inward).sizes()
            change = times_up(sizes, apart) if p > 1 else [[0] * len(here[0])] * len(here)
            moved = [[a + (p - 1) * b for a, b in zip(x, y, strict=True)] for x, y in zip(here, change, strict=True)]
            bound = times_up(moved, self.piece.slope)
            if p > 1:
                half = times_up(change, self.piece.size)
                bound = [
                    [a + (p - 1) * b // 2 + 1 for a, b in zip(x, y, strict=True)]
                    for x, y in zip(bound, half, strict=True)
                ]
            found = larger((summed @ area).sizes(), [[p * v for v in line] for line in bound])
            total = added(total, found) if total else found
        return total
