"""What a sampled loop makes of everything that acts on it: L1 norms of its impulse responses, in floats.

    Λ_oi = sup over phases of Σ_k ∫ |h_oi(θ + kT, s)| ds

for the outputs o = (z, s = a z + b v, v) at any time and c at the samples. h is a kernel of two times: the response of
output o at a phase of a period to an impulse at a time s of an earlier one (Bamieh, Dahleh and Pearson 1993 for sampled
data; Dahleh and Diaz-Bobillo 1995, ch. 7, for what such norms decide).

Between the phases of a grid an output is interpolated with h²/8 of its second derivative on top. Sources are summed
over sub-steps of length h in groups of p periods: where f keeps its sign, Σ∫|f| = |Σ∫f|; where it does not, f is no
larger than what its slopes make of the distance from a zero,

    Σ∫|f| <= p ( (p-1)/2 ∫|Δf| + max( ∫|f'(s)| s ds, ∫|f'(s)| (h - s) ds ) )

with Δf the change from a period to the next. Changes, and what comes after the last group, are bounded in coordinates
in which a period contracts every block.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .basis import Basis, basis_of, diagonal
from .stack import Stack
from .substep import SubStep
from .turn import Turn, turn

Array = NDArray[np.float64]

#: Sub-steps of a period for outputs and for sources.
PHASES, PARTS = 5, 3
#: A group is at most this share of the periods before it, and of the slowest mode's time.
GROWING, SLOWEST = 0.125, 0.12
#: In a group a mode turns by this angle at most, in rad, until it has shrunk to this size.
TURNED, GONE = 0.15, 0.05
#: A smaller angle counts as this.
TINY = 1e-9
#: Largest group.
LARGEST = 2_000
#: Periods are summed until the slowest mode is this small; the next one where what is left is overestimated
#: by more than this share of the sums.
LEFT, LEAST = (0.25, 0.05, 0.01), 0.02
#: Beside the others, a source of this size has no effect but that of rounding.
UNFELT = 1e-12
#: Groups at most.
LONGEST = 400
#: Weights of a period in the transient, as powers of the slowest mode.
SHARES = (0.2, 0.5, 0.8, 0.93)


@dataclass(frozen=True)
class Sums:
    """L1 norms from what acts to the outputs (z, s, v, c, w of leads, and what is bounded of an observer).

    Attributes:
        rest: From ρ_1 … ρ_n and the rates of the demands. Shape (outputs, n + q).
        pulses: From errors of the new inputs, of networks, leads and an observer's ẑ. Shape (outputs, pulses).
        noise: From measurement errors. Shape (outputs, n).
        begin: Largest responses to what Z(0) is made of. Shape (outputs, 2 n + q + m).
    """

    rest: Array
    pulses: Array
    noise: Array
    begin: Array


@dataclass(frozen=True, kw_only=True)
class Responses:
    """The sums of a stack, plain and weighted with powers of a growth a period.

    Attributes:
        stack: The loop.
        basis: Coordinates of the tail.
        groups: Numbers of periods that are summed together.
        plain: The sums.
        weighted: By growth.
    """

    stack: Stack
    basis: Basis
    groups: tuple[int, ...]
    plain: Sums
    weighted: Mapping[float, Sums]


def responses(stack: Stack) -> Responses | None:
    """Sum the responses of a loop; None where it is not stable, or contracts in no coordinates that are found."""
    one = turn(stack, PHASES)
    order = stack.order
    f = one.image[:, :order]
    poles: Any = np.linalg.eigvals(f)
    radius = float(np.max(np.abs(poles)))
    if not radius < 1 - 1e-9:
        return None
    basis = basis_of(f)
    if basis is None:
        return None
    reach = float(np.max(np.abs(np.linalg.eigvals(basis.norms))))
    if not reach < 1 - 1e-9:
        return None
    time = -1 / np.log(min(max(radius, 1e-6), 1 - 1e-12))
    growths = [float(f"{np.exp(share / time):.8e}") for share in SHARES]
    growths = [g for g in growths if reach * g < 1 - 1e-9]
    summation = _Sum(stack, one, basis, growths)
    for left in LEFT:
        made, share = summation.made(groups_of(poles, time, left))
        if share <= LEAST:
            break
    return made


def groups_of(poles: Any, time: float, left: float) -> tuple[int, ...]:
    """Numbers of periods that are summed together until a slowest mode of so many periods has the size `left`."""
    sizes, turns = np.abs(poles), np.abs(np.angle(poles))
    found, done = [1], 1
    while done < -np.log(left) * time and len(found) < LONGEST:
        turn = np.max(np.where(sizes**done > GONE, turns, 0.0))
        found.append(max(1, int(min(GROWING * done, SLOWEST * time, TURNED / max(turn, TINY), LARGEST))))
        done += found[-1]
    return tuple(found)


class _Sum:
    """A loop of which the sums are taken, whatever periods are summed together."""

    def __init__(self, stack: Stack, one: Turn, basis: Basis, growths: Sequence[float]) -> None:
        self.stack, self.one, self.basis, self.growths = stack, one, basis, growths
        self.flow, self.sources, order = stack.flow(), stack.sources(), stack.order
        self.lengths: dict[float, SubStep] = {}
        n, m, q = stack.sizes
        self.outputs = 2 * n + m
        self.cx = np.vstack([
            np.eye(n, n + q), np.hstack([stack.a, stack.b @ stack.direct]), np.hstack([np.zeros((m, n)), stack.direct]),
        ])  # fmt: skip
        through = np.vstack([np.zeros((n, m)), stack.b, np.eye(m)])
        early = [self.cx @ x + through @ v for x, v in zip(one.begin, one.held, strict=True)]
        late = [self.cx @ x + through @ v for x, v in zip(one.end, one.held, strict=True)]
        self.rows = np.vstack([*early, *late, one.shown])
        inside = basis.inverse @ one.image[:, :order] @ basis.columns
        self.block = diagonal(inside, basis.blocks)
        self.step_back = self.block - np.eye(order)
        self.acting = basis.inverse @ np.hstack([one.image[:, order:], stack.begin()])
        self.entry, self.part = basis.of_columns(self.acting), self._step(stack.period / PARTS)
        # sources of each sub-step of a period in coordinates y, and the same integrated
        self.inward = [basis.inverse @ one.fold]
        for _ in range(PARTS - 1):
            self.inward.append(self.inward[-1] @ self.part.forward)
        self.areas = [inward @ self.part.area for inward in self.inward]
        ways = zip(self.inward, self.areas, strict=True)
        self.tail = sum(np.maximum(*map(basis.of_columns, (area, np.abs(y) @ self.part.slope))) for y, area in ways)

    def _step(self, length: float) -> SubStep:
        if length not in self.lengths:
            self.lengths[length] = SubStep(self.flow, self.sources, length)
        return self.lengths[length]

    def made(self, groups: tuple[int, ...]) -> tuple[Responses, float]:
        """The sums, and the largest share of those to the first output by which what is left may be overestimated."""
        n, _, q = self.stack.sizes
        pulses, order, growths = self.stack.pulses, self.stack.order, [1.0, *self.growths]
        past, totals, after = self._past(groups)
        done, counts = np.cumsum((0, *groups)), np.array(groups)[:, None, None]
        # what acts in period P meets period P + k + 1 with weight growth^(k + 1); a group has the weight of its end
        weights = np.array(growths)[:, None] ** done[1:]
        rest = self._integrals(counts, past, totals, weights)
        felt, begun = self._discrete(counts, past, totals, weights, pulses + n)
        now, fixed = self._current(), np.abs(self.rows[:, order:]) + self._meanwhile()
        last = self.basis.of_rows(after)
        tails = [self._left(last, growth, growth ** float(done[-1])) for growth in growths]
        values = np.array([
            np.hstack([
                now + rest[k] + left[0], fixed + felt[k] + left[1][:, : pulses + n],
                np.maximum(begun[k], left[2][:, pulses + n :]),
            ])
            for k, left in enumerate(tails)
        ])  # fmt: skip
        ends = np.cumsum((n + q, pulses, n))
        sums = [Sums(*np.split(part, ends, axis=1)) for part in self._between(values)]
        # a kick may be over after the next sample, or begin before the one that it is counted after
        for part, growth in zip(sums if self.stack.kicked else [], growths, strict=False):
            part.pulses[:, pulses - n :] += growth * part.noise
        made = Responses(
            stack=self.stack, basis=self.basis, groups=groups, plain=sums[0],
            weighted=dict(zip(self.growths, sums[1:], strict=True)),
        )  # fmt: skip
        late, signed = tails[0][0][0], np.linalg.solve(-self.step_back.T, after[0]) @ sum(self.areas)
        whole = rest[0][0] + late
        return made, float(np.max((late - np.abs(signed)) / np.maximum(whole, UNFELT * np.max(whole))))

    def _past(self, groups: tuple[int, ...]) -> tuple[Array, Array, Array]:
        """Rows over y at the start of each group, their sums over each group, and the row after the last."""
        order = self.stack.order
        powers, sums = [np.eye(order)], [np.zeros((order, order))]
        for _ in range(max(groups)):
            sums.append(sums[-1] + powers[-1])
            powers.append(powers[-1] @ self.block)
        row, past = self.rows[:, :order] @ self.basis.columns, []
        for p in groups:
            past.append(row)
            row = row @ powers[p]
        first = np.array(past)
        return first, first @ np.array([sums[p] for p in groups]), row

    def _integrals(self, p: Array, past: Array, totals: Array, weights: Array) -> Array:
        """Weighted sums of ∫|past fold exp(flow (T - s)) sources| ds over a period, for each row of weights."""
        total = np.zeros((len(weights), past.shape[1], self.sources.shape[1]))
        sizes = self.basis.of_rows(past)
        for inward, area in zip(self.inward, self.areas, strict=True):
            change = sizes @ self.basis.of_columns(self.step_back @ inward)
            sloped = (np.abs(past @ inward) + (p - 1) * change) @ self.part.slope
            bound = p * (sloped + (p - 1) / 2 * (change @ self.part.size))
            total += np.tensordot(weights, np.maximum(np.abs(totals @ area), bound), 1)
        return total

    def _discrete(
        self, p: Array, past: Array, totals: Array, weights: Array, count: int
    ) -> tuple[Array, Array]:  # fmt: skip
        """Weighted sums of what acts at samples, and the largest of what starts; columns as in `acting`."""
        change = self.basis.of_rows(past) @ self.basis.of_columns(self.step_back @ self.acting)
        summed = np.maximum(
            np.abs(totals @ self.acting[:, :count]), p * (p - 1) / 2 * change[:, :, :count]
        )  # fmt: skip
        largest = np.abs(past @ self.acting[:, count:]) + (p - 1) * change[:, :, count:]
        first = np.array([(largest * (weight / weight[0])[:, None, None]).max(axis=0) for weight in weights])
        return np.tensordot(weights, summed, 1), first

    def _meanwhile(self) -> Array:
        """What z is otherwise while jitter decides which input acts: by a kick at most."""
        stack, n, size = self.stack, self.stack.sizes[0], self.outputs
        found = np.zeros((len(self.rows), stack.pulses + n))
        if stack.kicked:
            for first in range(0, 2 * len(self.one.steps) * size, size):
                found[first : first + n, stack.pulses - n : stack.pulses] = stack.meanwhile()[0]
        return found

    def _current(self) -> Array:
        """What acts in the period of the output, before it."""
        steps, size = self.one.steps, self.outputs
        count, parts = len(steps), [self._step(float(h)) for h in self.one.steps]
        found = np.zeros((len(self.rows), self.sources.shape[1]))
        for j in range(count):
            rows = self.cx
            for i in range(j, -1, -1):
                piece = parts[i].integral(rows)
                found[(count + j) * size : (count + j + 1) * size] += piece
                if j + 1 < count:
                    found[(j + 1) * size : (j + 2) * size] += piece
                rows = rows @ parts[i].forward
        # what the demands move while the input before still acts
        for first in range(2 * self.stack.sizes[0], 2 * count * size, size):
            found[first : first + self.stack.sizes[1], self.stack.sizes[0] :] += self.stack.jitter * self.stack.direct
        return found

    def _left(self, last: Array, growth: float, weight: float) -> tuple[Array, Array, Array]:
        """Bounds on what comes after the groups: sums of sources and of what acts at samples; largest of what starts.

        N^j x <= d for all j where x <= d and N d <= d.
        """
        norms, last = growth * self.basis.norms, last * weight
        reach = np.linalg.inv(np.eye(len(self.basis.blocks)) - norms)
        begun = self.entry + reach @ np.maximum(norms @ self.entry - self.entry, 0.0)
        size = growth * last @ reach
        return size @ self.tail, size @ self.entry, last @ begun

    def _between(self, values: Array) -> Array:
        """The largest values over all phases, from both ends of each sub-step, with the curvature between them.

        Args:
            values: By growth, at both ends of all sub-steps; of sources, which bend it themselves, and of the rest.
        """
        (n, _, q), size, steps = self.stack.sizes, self.outputs, self.one.steps
        shape = (len(values), len(steps), size, values.shape[2])
        early, late = np.split(values[:, : 2 * len(steps) * size], 2, axis=1)
        early, late = early.reshape(shape), late.reshape(shape)
        speed = np.zeros((*shape[:2], n + q, shape[3]))
        speed[:, :, :n] = early[:, :, n : 2 * n]
        speed[..., : n + q] += np.abs(self.sources)
        bend = np.abs(self.cx @ self.flow)
        bends = np.array([h**2 / 8 * (bend @ self._step(float(h)).ceiling) for h in steps])
        best = (np.maximum(early, late) + bends @ speed).max(axis=1)
        return np.concatenate([best, values[:, 2 * len(steps) * size :]], axis=1)
