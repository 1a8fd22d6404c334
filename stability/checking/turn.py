"""One control period of the whole sampled loop: plant, load networks and pending inputs as one exact map.

Theorem: variation of constants. Must fail: another delay, a network or a pending input left out.
"""

from __future__ import annotations

from fractions import Fraction

from .arithmetic import ZERO, Interval, add, down, mul, neg, up
from .claim import Cell, Claim
from .jitter import Jitter
from .lag import Lags
from .lead import sections
from .limits import FIXED, ROUNDING
from .loop import Loop
from .matrices import Ball, Matrix, ball, dot, exponential_of, identity

#: Sub-steps of a period for outputs.
PHASES = 5


def split_of(rows: list[list[Interval]]) -> tuple[Matrix, Matrix]:
    """Middles of intervals, and distances of the ends from them."""
    middle = [[down((low + high) / 2) for low, high in row] for row in rows]
    pairs = zip(rows, middle, strict=True)
    return middle, [[up(max(v[1] - m, m - v[0])) for v, m in zip(row, own, strict=True)] for row, own in pairs]


class Turn:
    """The loop of constant numbers for a part of the ranges, and what it leaves out.

    Everything is in units of the box: z_i of half_widths_i, v_k of input_bound_k, φ̂ - φ* of network_bound_q, time of
    the period. Z holds z, ζ of lags, φ̂ - φ*, the states of an observer, those of leads, and the pending inputs, newest
    first; columns of maps are over Z, then pulses on the new inputs, on the networks, on the leads and on what the
    observer sees, kicks of jitter to the states, and measurement errors of the states.
    """

    def __init__(self, claim: Claim, loop: Loop, cell: Cell, masses: list[Interval]) -> None:
        self.claim, self.loop = claim, loop
        self.n, self.m, self.q = len(claim.rows) + len(claim.lags), len(claim.inputs), len(claim.networks)
        self.w = 2 if claim.observer else 0
        self.filters = claim.leads * self.m
        self.first = self.n + self.q + self.w + self.filters
        self.order = self.first + self.m * claim.pending
        self.kicked, self.turns = (self.n, self.m) if claim.jitter > 0 else (0, 0)
        self.width = self.m + self.q + self.filters + self.w + self.kicked + self.n
        self.columns = self.order + self.width
        self._plant(cell, masses)
        self.more: list[Fraction] = []
        self.lags = Lags(self)
        self._controller()
        self._observer()
        self.jitter = Jitter(self) if claim.jitter > 0 else None
        self._flow()
        self._phases()
        self._sample()

    def _plant(self, cell: Cell, masses: list[Interval]) -> None:
        """a, b and how far they may be from the truth; μ; known bounds on what acts."""
        claim, loop, n, m = self.claim, self.loop, len(self.claim.rows), self.m
        mass = [down(2 / (1 / low + 1 / high)) for low, high in masses]
        self.change = [up(max(m0 / low - 1, 1 - m0 / high)) for m0, (low, high) in zip(mass, masses, strict=True)]
        rate = [claim.period / (m0 * r) for m0, r in zip(mass, claim.half_widths, strict=True)]

        def scaled(found: Interval, taken: Fraction, factor: Fraction) -> tuple[Fraction, Fraction]:
            return taken * factor, up(max(found[1] - taken, taken - found[0], Fraction(0)) * factor)

        force = [[scaled(loop.entry(i, j), cell.force[i][j], rate[i] * claim.half_widths[j]) for j in range(n)]
                 for i in range(n)]  # fmt: skip
        drive = [[scaled(loop.closed[i].get(f"e{k}", ZERO), cell.drive[i][k], rate[i] * claim.input_bound[k])
                  for k in range(m)] for i in range(n)]  # fmt: skip
        (self.a, self.a_spread), (self.b, self.b_spread) = (
            ([[v[0] for v in row] for row in part], [[v[1] for v in row] for row in part]) for part in (force, drive)
        )
        self.late = [up(loop.late(k) / claim.input_bound[k]) for k in range(m)]
        self.push = [
            up((1 + self.change[i]) * (loop.disturbance[i] * rate[i] + sum(
                ((abs(self.b[i][k]) + self.b_spread[i][k]) * self.late[k] for k in range(m)), Fraction(0))))
            for i in range(n)
        ]  # fmt: skip
        pairs = zip(loop.demand_rate, claim.network_bound, strict=True)
        self.moving = [up(claim.period * r / bound) for r, bound in pairs]

    def _controller(self) -> None:
        """The discrete part over (ẑ, c, w): middles and distances from them; how Z(0) follows from Q(0) and φ̂(0)."""
        claim, loop, n, q = self.claim, self.loop, len(self.claim.rows), self.q
        filtered = [claim.half_widths[row] for row in claim.input_map for _ in range(claim.leads)]
        scale = [*claim.half_widths, *claim.network_bound, *filtered]
        own = claim.networks

        def action(i: int, error: list[Interval]) -> list[Interval]:
            """-b_i times an error, less c_i."""
            row = [mul(neg(loop.half[i]), v) for v in error]
            if i in own:
                row[n + own.index(i)] = add(row[n + own.index(i)], (Fraction(-1), Fraction(-1)))
            return row

        def error(i: int) -> list[Interval]:
            """Q_i."""
            row, target = [ZERO] * len(scale), claim.rows[i]["target"]
            row[i] = (Fraction(1), Fraction(1))
            if not isinstance(target, int):
                return row
            return [add(v, neg(w)) for v, w in zip(row, action(target, error(target)), strict=True)]

        acts, smooths = [], []
        for k, i in enumerate(claim.input_map):
            places = [n + q + place for place in claim.places_of_leads(i)]
            ahead, following = sections(error(i), loop.gain[i], claim.period, places)
            acts.append(_in_units(action(i, ahead), scale, claim.input_bound[k]))
            smooths += [_in_units(row, scale, claim.half_widths[i]) for row in following]
        learns = []
        for j, i in enumerate(own):
            rate = mul(loop.gain[i].gamma, _point(claim.period / claim.network_bound[j]))
            learns.append([mul(mul(rate, v), _point(s)) for v, s in zip(error(i), scale, strict=True)])
        self.lags.unread([*acts, *learns, *smooths])
        acts, learns, smooths = ([self.lags.spaced(row) for row in part] for part in (acts, learns, smooths))
        (self.act, self.act_spread), (self.learn, self.learn_spread) = split_of(acts), split_of(learns)
        self.smooth, self.smooth_spread = split_of(smooths)
        starts = []
        for i, row in enumerate(claim.rows):
            start, target = [ZERO] * (n + q), row["target"]
            start[i] = _point(Fraction(1))
            if isinstance(target, int):
                start[target] = mul(neg(loop.gain[target].beta), _point(Fraction(1, 2)))
                if target in own:
                    start[n + own.index(target)] = _point(Fraction(-1))
            starts.append(_in_units(start, scale[: n + q], claim.half_widths[i]))
        starts = [self.lags.spaced(row) for row in starts] + [[ZERO] * (self.n + q) for _ in claim.lags]
        self.start, self.start_spread = split_of(starts)
        self.noise = [up(v / r) for v, r in zip(claim.noise, claim.half_widths, strict=True)]
        self.noise += [Fraction(0)] * len(claim.lags)
        self.blur = [up(loop.term_noise(row) / claim.input_bound[k]) for k, row in enumerate(claim.input_map)]

    def _observer(self) -> None:
        """What the controller sees of z, over the columns; what is bounded of an observer, and rounding of its gains.

        x̂ = ξ + l_1 (y - ξ), ŝ = η + l_2 (y - ξ); bounded are the errors of both, and y - ξ.
        """
        claim, unit, noise = self.claim, identity(self.columns), self.columns - self.n
        self.seen = [_sum(unit[i], unit[noise + i]) for i in range(self.n)]
        self.shown: Matrix = []
        self.blind: list[Fraction] = []
        if not claim.observer:
            return
        per = claim.half_widths[0] / claim.half_widths[1]
        gains, place, pulse = (
            (claim.observer[0], claim.observer[1] * per),
            self.n + self.q,
            noise - self.kicked - self.w,
        )
        missed = [v - w for v, w in zip(self.seen[0], unit[place], strict=True)]
        for i, gain in enumerate(gains):
            self.seen[i] = _sum(unit[place + i], [gain * v for v in missed], unit[pulse + i])
        errors = [[v - w for v, w in zip(self.seen[i], unit[i], strict=True)] for i in range(2)]
        scale = *claim.half_widths[:2], claim.half_widths[0]
        sizes = [r / bound for r, bound in zip(scale, claim.shown, strict=True)]
        self.shown = [[v * size for v in row] for row, size in zip([*errors, missed], sizes, strict=True)]
        self.blind = [up(ROUNDING * gain / sizes[2]) for gain in gains]
        self.ahead = [[Fraction(1), claim.period / per], [Fraction(0), Fraction(1)]]

    def _flow(self) -> None:
        """(z, p)' = flow (z, p) + (b, 0) held; p is what each demand moves since the last sample."""
        claim, n, m, q = self.claim, self.n, self.m, self.q
        width = n + q
        bounds = claim.network_bound
        pairs, own = list(zip(claim.input_map, claim.input_bound, strict=True)), list(enumerate(claim.networks))
        self.direct = [[Fraction(int(row == i)) * bounds[j] / size for j, i in own] for row, size in pairs]
        self.flow = [[Fraction(0)] * width for _ in range(width)]
        self.sources = [[Fraction(int(i == j)) for j in range(width)] for i in range(width)]
        for i in range(n):
            self.flow[i][:n] = self.a[i]
            for j, row in enumerate(claim.networks):
                self.flow[i][n + j] = sum((self.b[i][k] * self.direct[k][j] for k in range(m)), Fraction(0))
                if i < len(claim.rows) and claim.rows[i]["target"] == row:
                    self.sources[i][n + j] = bounds[j] / claim.half_widths[i]

    def turned(self) -> Matrix:
        """How much the inputs change that act in a period, over the columns; only with jitter."""
        if not self.kicked:
            return []
        old, new = self._waited(self.claim.whole + 1), self._waited(self.claim.whole)
        return [[v - w for v, w in zip(*rows, strict=True)] for rows in zip(new, old, strict=True)]

    def held(self, k: int) -> Ball:
        """The input computed k samples ago, over the columns."""
        return ball(self._waited(k))

    def _waited(self, k: int) -> Matrix:
        if k:
            place = self.first + self.m * (k - 1)
            return identity(self.columns)[place : place + self.m]
        return [self._computed(row, self.order + i) for i, row in enumerate(self.act)]

    def _computed(self, row: list[Fraction], own: int) -> list[Fraction]:
        """What the controller makes of what it sees and of its networks, with a pulse of its own, over the columns."""
        made = [dot(row[: self.n], column) for column in zip(*self.seen, strict=True)]
        for j, value in enumerate(row[self.n :]):
            # the states of an observer stand between networks and leads
            made[self.n + j + (self.w if j >= self.q else 0)] += value
        made[own] += 1
        return made

    def _phases(self) -> None:
        """(z, p) and the held input at both ends of every sub-step, over the columns."""
        claim, n, m, q = self.claim, self.n, self.m, self.q
        before = [(claim.share, self.held(claim.whole + 1), False)] if claim.share > 0 else []
        parts = [*before, (1 - claim.share, self.held(claim.whole), bool(self.kicked))]
        whole = [[*row, *(self.b[i] if i < n else [Fraction(0)] * m)] for i, row in enumerate(self.flow)]
        whole += [[Fraction(0)] * (n + q + m) for _ in range(m)]
        x = Ball([[int(i == j and i < n) << FIXED for j in range(self.columns)] for i in range(n + q)], 0)
        self.steps: list[Fraction] = []
        self.ends: list[tuple[Ball, Ball, Ball]] = []
        for share, acting, switched in parts:
            if switched:
                place = self.columns - self.n - self.kicked
                kick = Ball(
                    [[int(c == place + i and i < n) << FIXED for c in range(self.columns)] for i in range(n + q)], 0
                )
                x = x + kick
            pieces = max(1, round(PHASES * share))
            length = share / pieces
            forward = exponential_of([[v * length for v in row] for row in whole])
            free, driven = (
                forward.part(slice(0, n + q), slice(0, n + q)),
                forward.part(slice(0, n + q), slice(n + q, None)),
            )
            for _ in range(pieces):
                following = free @ x + driven @ acting
                self.ends.append((x, following, acting))
                self.steps.append(length)
                x = following
        self.end = x

    def _sample(self) -> None:
        """Z at the next sample over the columns; how (z, p) at the end of a period enters it; what Z(0) is made of."""
        claim, n, m, q, order = self.claim, self.n, self.m, self.q, self.order
        fold = [[Fraction(0)] * (n + q) for _ in range(order)]
        kept = [[Fraction(0)] * self.columns for _ in range(order)]
        for i in range(n):
            fold[i][i] = Fraction(1)
        for j in range(q):
            fold[n + j][n + j] = Fraction(-1)
            kept[n + j] = self._computed(self.learn[j], order + m + j)
            kept[n + j][n + j] += 1
        for j, row in enumerate(self.smooth):
            kept[n + q + self.w + j] = self._computed(row, order + m + q + j)
        for i in range(self.w):
            kept[n + q + i] = [dot(self.ahead[i], column) for column in zip(*self.seen[:2], strict=True)]
        moved = ball(kept)
        for k in range(claim.pending):
            for i in range(m):
                fold[self.first + m * k + i][n:] = self.direct[i]
            held = self.held(k)
            for i in range(m):
                moved.rows[self.first + m * k + i] = held.rows[i]
        self.fold = ball(fold)
        self.image = self.fold @ self.end + moved
        # Z(0) over Q(0), c(0), measurement errors, errors of the modelling terms
        width = 2 * n + q + m
        unit = identity(width)
        begin = [[*row, *[Fraction(0)] * (n + m)] for row in self.start]
        first = [_sum(row, noise) for row, noise in zip(begin, unit[n + q : 2 * n + q], strict=True)]
        if self.w:  # an observer starts from the first measurement, and at the reference's speed
            first[1] = [Fraction(0)] * width
        begin = [*begin, *unit[n : n + q], *first[: self.w], *[[Fraction(0)] * width] * self.filters]
        for _ in range(claim.pending):
            for k, row in enumerate(self.act):
                made = [dot(row[:n], column) for column in zip(*first, strict=True)]
                for j in range(q):
                    made[n + j] += row[n + j]
                begin.append(_sum(made, unit[2 * n + q + k]))
        self.begin = ball(begin)

    def started(self) -> tuple[list[Fraction], list[Fraction]]:
        """What Z(0) is made of, and bounds on what is not known of its coefficients.

        A network starts at its preload under any demand of the range, or where it rested before.
        """
        claim, n, q = self.claim, self.n, self.q
        first = [up(v / r) for v, r in zip(claim.initial, claim.half_widths, strict=True)]
        first += [Fraction(0)] * len(claim.lags)
        for j, i in enumerate(claim.networks):
            (low, high), preload = claim.demand[j], self.loop.gain[i].preload
            away = max(abs(preload - low), abs(high - preload)) + ROUNDING * abs(preload)
            first.append(up(max(away, self.loop.settled[j]) / claim.network_bound[j]))
        loose = [dot(row, first) for row in self.start_spread]
        size = [dot(map(abs, row), first) for row in self.start]
        unsure = [up(v) for v in loose] + [Fraction(0)] * q + [up(v) for v in loose[: self.w]]
        unsure += [Fraction(0)] * self.filters
        felt = [z + w + noise for z, w, noise in zip(size, loose, self.noise, strict=True)] + first[n:]
        felt += [Fraction(0)] * self.filters
        held = [up(dot(map(abs, self.act[k][:n]), loose) + dot(self.act_spread[k], felt)) for k in range(self.m)]
        return [*first, *self.noise, *self.blur], unsure + held * claim.pending


def _sum(*rows: list[Fraction]) -> list[Fraction]:
    return [sum(column, Fraction(0)) for column in zip(*rows, strict=True)]


def _in_units(row: list[Interval], units: list[Fraction], own: Fraction) -> list[Interval]:
    """A row over other units, in its own."""
    return [mul(v, _point(unit / own)) for v, unit in zip(row, units, strict=True)]


def _point(value: Fraction) -> Interval:
    return value, value
