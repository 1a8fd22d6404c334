"""The map over a control period and the positive system that bounds it.

Theorem: |y(t + T)| <= A |y| + b at every vertex of the inertias, by comparison (docs/proof.md). Must fail: other
coordinates, fewer cells, a cell of another range.
"""

from __future__ import annotations

from fractions import Fraction
from itertools import product

from .arithmetic import ZERO, Interval, add, down, magnitude, mul, neg, up
from .claim import Cell, Claim
from .deviation import Deviation
from .limits import FIXED_ERROR
from .matrices import Matrix, absolute, dot, exponential_times, identity, inverse_of, negative, product_of, sum_of


def middle_and_spread(bounds: Interval, factor: Fraction) -> tuple[Fraction, Fraction]:
    """Middle of an interval times a positive factor, and distance of the ends from it."""
    low, high = down(bounds[0] * factor), up(bounds[1] * factor)
    middle = down((low + high) / 2)
    return middle, max(high - middle, middle - low)


class Period:
    """|y(t + T)| <= A |y| + b for y = W z, at every vertex of the uncertain inertias; see `docs/proof.md`.

    Everything is in units of the box: z_i of half_widths_i, v_k of input_bound_k, time of the period.
    """

    def __init__(self, claim: Claim, loop: Deviation, cell: Cell, masses: list[Interval]) -> None:
        self.claim, self.loop, self.cell, self.masses = claim, loop, cell, masses
        self.n, self.m = len(claim.rows), len(claim.inputs)
        self._nominal()
        self.w = [[v * r for v, r in zip(row, claim.half_widths, strict=True)] for row in cell.transform]
        self.back = inverse_of(self.w)
        self._rest()
        self._vertices()
        self.motion = self._fold(sum_of(self.end[self.n : 2 * self.n], self.end[2 * self.n : 3 * self.n]))
        self.half_way = [self._half_way(i) for i in range(self.n)]

    def _half_way(self, i: int) -> Fraction:
        """T/2 sup|z_i'| over the box: how far z_i gets from the nearest sample."""
        claim, loop = self.claim, self.loop
        force = sum((magnitude(loop.entry(i, j)) * r for j, r in enumerate(claim.half_widths)), loop.disturbance[i])
        for k, input_bound in enumerate(claim.input_bound):
            force += magnitude(loop.closed[i].get(f"e{k}", ZERO)) * input_bound
        return claim.period * force / (2 * self.masses[i][0] * claim.half_widths[i])

    def _nominal(self) -> None:
        claim, loop, n, m = self.claim, self.loop, self.n, self.m
        self.mass = [down(2 / (1 / low + 1 / high)) for low, high in self.masses]
        self.change = [
            up(max(m0 / low - 1, 1 - m0 / high)) for m0, (low, high) in zip(self.mass, self.masses, strict=True)
        ]
        rate = [claim.period / (m0 * r) for m0, r in zip(self.mass, claim.half_widths, strict=True)]
        state = [
            [middle_and_spread(loop.entry(i, j), rate[i] * claim.half_widths[j]) for j in range(n)] for i in range(n)
        ]
        entry = [
            [middle_and_spread(loop.closed[i].get(f"e{k}", ZERO), rate[i] * claim.input_bound[k]) for k in range(m)]
            for i in range(n)
        ]
        feedback = [
            [
                middle_and_spread(f, r / claim.input_bound[k])
                for f, r in zip(loop.feedback(k), claim.half_widths, strict=True)
            ]
            for k in range(m)
        ]
        (self.a, self.a_spread), (self.b, self.b_spread), (self.k, self.k_spread) = (
            ([[v[0] for v in row] for row in part], [[v[1] for v in row] for row in part])
            for part in (state, entry, feedback)
        )
        self.push = [up(d * r) for d, r in zip(loop.disturbance, rate, strict=True)]
        self.noise = [up(loop.noise_of(k) / claim.input_bound[k]) for k in range(m)]
        self.drift = [up(claim.period * loop.drift(k) / claim.input_bound[k]) for k in range(m)]
        self.drive = sum_of(self.a, negative(product_of(self.b, self.k)))

    def _rest(self) -> None:
        """The positive system that bounds what the nominal map leaves out, integrated over a period."""
        n, m, change = self.n, self.m, self.change
        reach = sum_of(absolute(self.b), self.b_spread)
        varying = product_of(reach, self.k_spread)
        ramp, here, inputs, one = (3 + n) * n, (3 + n) * n + m, (4 + n) * n + m, (4 + n) * n + 2 * m
        size = one + 1
        system = [[Fraction(0)] * size for _ in range(size)]
        for i in range(n):
            source = [Fraction(0)] * size
            for j in range(n):
                source[here + j] = self.a_spread[i][j] + varying[i][j]
                source[n + j] = source[2 * n + j] = self.a_spread[i][j]
                own = i == j
                system[i][j] = self.a[i][j] if own else abs(self.a[i][j])
                system[n + i][j] = Fraction(int(own))
            for k in range(m):
                source[ramp + k], source[inputs + k] = reach[i][k], self.b_spread[i][k]
            source[one] = self.push[i]
            system[2 * n + i] = [(1 + change[i]) * v for v in source]
            system[2 * n + i][i] += change[i]
            for j in range(n):
                grow = max(self.a[i][i], Fraction(0)) if i == j else abs(self.a[i][j])
                system[2 * n + i][2 * n + j] += grow + change[i] * abs(self.a[i][j])
            first = (3 + i) * n
            for k in range(n):
                system[first + k][first : first + n] = system[k][:n]
            for j, value in enumerate(source):
                system[first + i][j] += value
            for j in range(n):
                system[first + i][2 * n + j] += change[i] / (1 - change[i]) * abs(self.a[i][j])
        for k in range(m):
            system[ramp + k][one] = self.drift[k]
        system = [[up(v) for v in row] for row in system]
        begin = [[Fraction(0)] * (2 * n + m + 1) for _ in range(size)]
        for j in range(n):
            begin[here + j][j] = begin[j][n + j] = Fraction(1)
        for k in range(m):
            begin[inputs + k][2 * n + k] = Fraction(1)
        begin[one][-1] = Fraction(1)
        self.end = [[up(v + FIXED_ERROR) for v in row] for row in exponential_times(system, begin)]

    def _fold(self, block: Matrix) -> tuple[Matrix, list[Fraction]]:
        """Rows over (|z|, |c|, |v|, 1) as rows over (|y|, 1)."""
        n = self.n
        parts = (([row[:n] for row in block], absolute(self.back)), ([row[n : 2 * n] for row in block], self.speed))
        parts += (([row[2 * n : -1] for row in block], self.control),)
        moving = sum_of(*(product_of(*p) for p in parts))
        # the noise adds to the held input, and so to the speed at the start of a period
        known = [dot(map(abs, row), self.noise) for row in self.b]
        return moving, [dot(row[n:-1], known + self.noise) + row[-1] for row in block]

    def _vertices(self) -> None:
        n, m, w, back = self.n, self.m, self.w, self.back
        whole = [[*a, *b] for a, b in zip(self.a, self.b, strict=True)] + [[Fraction(0)] * (n + m)] * m
        flow = exponential_times(whole, identity(n + m))
        input_bound = [row[n:] for row in flow[:n]]
        entry = product_of(input_bound, self.k)
        closed = sum_of([row[:n] for row in flow[:n]], negative(entry))
        self.control = sum_of(absolute(product_of(self.k, back)), product_of(self.k_spread, absolute(back)))
        self.speed = absolute(product_of(self.drive, back))
        effects = {i: product_of(w, self._effect(i)) for i in range(n) if self.change[i] > 0}
        noise = [[v] for v in self.noise]
        shaken = product_of(absolute(product_of(w, input_bound)), noise)
        for i, effect in effects.items():
            direct = product_of(absolute(product_of(effect, self.b)), noise)
            shaken = sum_of(shaken, [[self.change[i] * v for v in row] for row in direct])
        effects = {i: product_of(effect, self.drive, back) for i, effect in effects.items()}
        shares = []
        for i in range(n):
            moving, push = self._fold(self.end[(3 + i) * n : (4 + i) * n])
            spread = [row[0] for row in product_of(absolute(w), [[v] for v in push])]
            shares.append((product_of(absolute(w), moving), spread))
        base, self.vertices = product_of(w, closed, back), []
        # errors of the exponentials of this method, in units of the box: of Φ, Γ and each effect
        slack = (
            (n * n + 4 * (n + m + 2)) * FIXED_ERROR * (1 + max(abs(v) for row in (*self.drive, *self.b) for v in row))
        )
        error = product_of(absolute(w), [[slack] * n] * n, absolute(back))
        error = sum_of(error, product_of(absolute(w), [[slack] * m] * n, self.control))
        shaken = sum_of(shaken, product_of(absolute(w), [[slack] * m] * n, noise))
        for signs in product((-1, 1), repeat=len(effects)):
            change = dict(zip(effects, signs, strict=True))
            change = {i: sign * self.change[i] for i, sign in change.items()}
            moving = [[Fraction(0)] * n for _ in range(n)]
            push = [Fraction(0)] * n
            for r, c in product(range(n), repeat=2):
                signed = base[r][c] + sum((d * effects[i][r][c] for i, d in change.items()), Fraction(0))
                shared = sum((1 + change.get(i, 0)) * shares[i][0][r][c] for i in range(n))
                moving[r][c] = up(abs(signed) + shared + error[r][c])
            for r in range(n):
                push[r] = up(sum(((1 + change.get(i, 0)) * shares[i][1][r] for i in range(n)), shaken[r][0]))
            self.vertices.append((moving, push))

    def _effect(self, i: int) -> Matrix:
        """∫ exp(a (1 - t)) e_i e_i' exp(a t) dt: how a change of the inertia of row i moves the end of a period."""
        n = self.n
        block = [[*row, *([Fraction(0)] * n)] for row in self.a] + [[*([Fraction(0)] * n), *row] for row in self.a]
        block[i][n + i] = Fraction(1)
        return exponential_times(block, [[Fraction(0)] * n] * n + identity(n))[:n]

    def image(self, bound: list[Fraction], push: bool = True) -> list[Fraction]:
        """The largest A |y| + b over the vertices, for |y| <= bound; without b where `push` is false."""
        values = []
        for moving, shift in self.vertices:
            step = [dot(row, bound) for row in moving]
            values.append([v + s for v, s in zip(step, shift, strict=True)] if push else step)
        return [max(column) for column in zip(*values, strict=True)]

    def initial(self) -> list[Fraction]:
        """|y(0)| over the initial errors: z_i(0) = Q_i(0) - b_t Q_t(0), θ̂ = 0."""
        claim = self.claim
        total = []
        for row in self.cell.transform:
            weights = [(v, v) for v in row]
            for i, entry in enumerate(claim.rows):
                if not isinstance(entry["target"], str):
                    half = mul(self.loop.gain[entry["target"]].beta, (Fraction(1, 2), Fraction(1, 2)))
                    weights[entry["target"]] = add(weights[entry["target"]], neg(mul((row[i], row[i]), half)))
            total.append(sum(magnitude(v) * q for v, q in zip(weights, claim.initial, strict=True)))
        return total

    def states(self, bound: list[Fraction]) -> list[Fraction]:
        """Bounds on |z(t)| for all t, between samples too, in units of the box, for |y| <= bound at the samples."""
        moving, push = self.motion
        found = []
        for i in range(self.n):
            moved = min(dot(moving[i], bound) + push[i], self.half_way[i])
            found.append(up(dot(map(abs, self.back[i]), bound) + moved))
        return found

    def speeds(self, bound: list[Fraction]) -> list[Fraction]:
        """Bounds on |z_i'| for all t, in the box's unit a period, for |y| <= bound at the samples."""
        here = [dot(map(abs, row), bound) for row in self.back]
        # from the sample before, whose state the held input answers to
        moving, push = self.motion
        drawn = [dot(row, bound) + p for row, p in zip(moving, push, strict=True)]
        moved = [min(own, 2 * half) for own, half in zip(drawn, self.half_way, strict=True)]
        total = [a + b for a, b in zip(here, moved, strict=True)]
        shaken = [n + d + dot(row, here) for n, d, row in zip(self.noise, self.drift, self.k_spread, strict=True)]
        found = []
        for i in range(self.n):
            size = dot(self.speed[i], bound) + dot(map(abs, self.a[i]), moved) + dot(map(abs, self.b[i]), shaken)
            size += dot(self.a_spread[i], total) + sum(self.b_spread[i], self.push[i])
            found.append(up(min((1 + self.change[i]) * size, 2 * self.half_way[i])))
        return found

    def inputs(self, bound: list[Fraction]) -> list[Fraction]:
        """Bounds on |u - m|, noise and drift included, in units of the box."""
        rows = zip(self.control, self.noise, self.drift, strict=True)
        return [dot(row, bound) + noise + drift for row, noise, drift in rows]
