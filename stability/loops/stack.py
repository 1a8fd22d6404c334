"""One control period of the whole sampled loop: plant deviations, load networks and pending inputs as one exact map.

    z' = a z + b v + ρ,   p_k' = φ*_k',   v = held + p,      Z = (z, c, ξ, w, pending inputs, newest first)

inside a period, where p is what a demand moves since the last sample; z_i' gets φ*_j' where row i tracks a row j with
a network. At a sample the new input, c and w, the states of sections of lead, are sums of ẑ, c and w; c moves by -p
too, and the pending inputs move on by one and by p. ẑ is z as it
is measured, or for the first two states what an observer with the states ξ makes of the first. With a delay
of so many whole periods and a share, the input switches from one pending value to the next at that share of a period.
With jitter it may switch earlier or later: that is a kick to z at this instant, as large as what acts meanwhile makes.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from ..enclosures.interval import Interval
from .box import DeviationRows
from .deviation import ROUNDED, networks
from .lead import sections
from .model import Gains, LoopModel
from .observer import SHOWN, STATES, Observer
from .ranges import Range
from .substep import integrals_of

Array = NDArray[np.float64]

#: A switch this close to a sample is at it, as a share of the period.
AT_ONCE = 1e-9
#: Largest delay in periods: every pending input is a state of the loop.
MAX_DELAY = 8


@dataclass(frozen=True, kw_only=True)
class Controller:
    """The discrete part of the loop in deviations: rows over (ẑ, c, w of the leads), middles and radii.

    Attributes:
        act: The new inputs v. Shape (m, n + q + l).
        act_spread: Its radius.
        learn: C at the next sample. Shape (q, n + q + l).
        learn_spread: Its radius.
        smooth: w at the next sample. Shape (l, n + q + l).
        smooth_spread: Its radius.
        start: z over (Q, c) where nothing has been adapted yet. Shape (n, n + q).
    """

    act: Array
    act_spread: Array
    learn: Array
    learn_spread: Array
    smooth: Array
    smooth_spread: Array
    start: Array


def controller(model: LoopModel, gains: tuple[Gains, ...], rows: DeviationRows, period: float) -> Controller:
    """Q_i = z_i + b_j Q_j + c_j along the rows that track each other; v = -b L Q - c; c <- c + T γ Q; w of L."""
    governed, own = list(model.controlled), networks(model, gains)
    n, q = len(model.rows), len(own)
    size = n + q + model.leads * len(model.inputs)
    found: dict[int, Range] = {}
    filters: list[Range] = []

    def error(i: int) -> Range:
        """Q_i."""
        if i not in found:
            value, target = _unit(size, i), model.rows[i].target
            if isinstance(target, int):
                value = value + action(target, error(target)).times(Interval(-1.0))
            found[i] = value
        return found[i]

    def action(i: int, error: Range) -> Range:
        """κ_i less its operating value: -b_i times an error, less c_i."""
        g = governed.index(i)
        control = error.times(Interval(-rows.half_high[g], -rows.half_low[g]))
        return control + _unit(size, n + own.index(i)).times(Interval(-1.0)) if i in own else control

    def leading(k: int, i: int) -> Range:
        """What the leads of input k make of Q_i; keeps what they remember."""
        g, first = gains[governed.index(i)], n + q + model.leads * k
        times = Interval(g.lead) * ROUNDED, Interval(g.smooth) * ROUNDED
        ahead, following = sections(error(i), *times, period, list(range(first, first + model.leads)))
        filters.extend(following)
        return ahead

    actions = [action(i, leading(k, i)) for k, i in enumerate(model.input_map)]
    rates = [period * gains[governed.index(i)].gamma for i in own]
    learned = [
        _unit(size, n + j) + error(i).times(Interval(r) * ROUNDED)
        for j, (i, r) in enumerate(zip(own, rates, strict=True))
    ]
    (act, loose), (learn, spread), (smooth, astray) = (_split(part, size) for part in (actions, learned, filters))
    return Controller(
        act=act, act_spread=loose, learn=learn, learn_spread=spread, smooth=smooth, smooth_spread=astray,
        start=_start(model, gains, own),
    )  # fmt: skip


def _unit(size: int, place: int) -> Range:
    return Range.of(np.eye(size)[place])


def _split(rows: list[Range], size: int) -> tuple[Array, Array]:
    """Middles and radii. Shapes (rows, size)."""
    parts = [[r.middle for r in rows], [r.radius for r in rows]]
    return np.array(parts[0]).reshape(-1, size), np.array(parts[1]).reshape(-1, size)


def _start(model: LoopModel, gains: tuple[Gains, ...], own: list[int]) -> Array:
    """z_i = Q_i - b_j Q_j - c_j with b = β/2; what rounding makes of it is left to the checker."""
    n, governed = len(model.rows), list(model.controlled)
    back = np.eye(n, n + len(own))
    for i, row in enumerate(model.rows):
        if isinstance(row.target, int):
            back[i, row.target] = -gains[governed.index(row.target)].beta / 2
            if row.target in own:
                back[i, n + own.index(row.target)] = -1.0
    return back


@dataclass(frozen=True, kw_only=True)
class Stack:
    """The loop of constant numbers.

    Attributes:
        a: Shape (n, n), rows divided by a middle inertia.
        b: Shape (n, m).
        steering: Which z_i' gets φ*_k'. Shape (n, q).
        direct: Which input meets φ*_k. Shape (m, q).
        control: The discrete part.
        period: T, s.
        whole: Whole periods of delay.
        share: The rest of the delay as a share of the period, 0 or more and below 1.
        observer: What makes ẑ_1 and ẑ_2 of z_1; None where all are measured.
        jitter: How much earlier or later than that an input may begin to act, s.
        lags: Rows that are followed by a state ζ of their own each, see `with_lags`.
    """

    a: Array
    b: Array
    steering: Array
    direct: Array
    control: Controller
    period: float
    whole: int
    share: float
    observer: Observer | None = None
    jitter: float = 0.0
    lags: tuple[int, ...] = ()

    @property
    def watched(self) -> int:
        """Number of states w of the observer."""
        return STATES if self.observer is not None else 0

    @property
    def shown(self) -> int:
        """Number of outputs of the observer: ẑ_1 - z_1, ẑ_2 - z_2, and what w corrects itself by."""
        return SHOWN if self.observer is not None else 0

    @property
    def kicked(self) -> int:
        """Number of states that jitter kicks."""
        return self.a.shape[0] if self.jitter > 0 else 0

    @property
    def turned(self) -> int:
        """Number of outputs that say by how much an input changes from a sample to the next."""
        return self.b.shape[1] if self.jitter > 0 else 0

    @property
    def pulses(self) -> int:
        """Number of what acts at samples beside measurement errors: on inputs, networks, leads, ẑ; kicks."""
        _, m, q = self.sizes
        return m + q + self.leads + self.watched + self.kicked

    @property
    def leads(self) -> int:
        """Number of states w of sections of lead."""
        return len(self.control.smooth)

    def meanwhile(self) -> tuple[Array, Array]:
        """Entrywise bounds on |e^{a s}| and on its integral over 0 <= s <= jitter. Shapes (n, n)."""
        grown, area, _ = integrals_of(np.abs(self.a), self.jitter)
        return grown, area

    @property
    def pending(self) -> int:
        """Number of samples whose inputs are still to act."""
        return self.whole + (self.share > 0 or self.jitter > 0)

    @property
    def sizes(self) -> tuple[int, int, int]:
        """Numbers of plant states, inputs, and networks."""
        return self.a.shape[0], self.b.shape[1], self.steering.shape[1]

    @property
    def order(self) -> int:
        """Length of Z."""
        m = self.sizes[1]
        return self.first + m * self.pending

    @property
    def first(self) -> int:
        """Where the pending inputs begin in Z."""
        n, _, q = self.sizes
        return n + q + self.watched + self.leads

    def seen(self) -> tuple[Array, Array]:
        """ẑ over z, measurement errors alike, and over w. Shapes (n, n), (n, w)."""
        n = self.sizes[0]
        of_states, of_observer = np.eye(n), np.zeros((n, self.watched))
        if self.observer is not None:
            first, second = self.observer.first, self.observer.second
            of_states[:2], of_observer[:2] = 0.0, [[1 - first, 0.0], [-second, 1.0]]
            of_states[:2, 0] = first, second
        return of_states, of_observer

    @property
    def ahead(self) -> Array:
        """W after a sample over ẑ_1 and ẑ_2. Shape (2, 2)."""
        return np.array([[1.0, self.period], [0.0, 1.0]])

    def begin(self) -> Array:
        """Z(0) over what it is made of: Q(0), c(0), measurement errors, and errors of the inputs.

        The inputs that are pending at the start are the first that is computed. Shape (order, 2 n + q + m).
        """
        (n, m, q), ctl = self.sizes, self.control
        made = np.zeros((self.order, 2 * n + q + m))
        made[:n, : n + q], made[n : n + q, n : n + q] = ctl.start, np.eye(q)
        if self.observer is not None:
            made[n + q, : n + q], made[n + q, n + q] = ctl.start[0], 1.0
        of_states, of_observer = self.seen()
        act = ctl.act[:, :n]
        first = act @ (of_states @ made[:n] + of_observer @ made[n + q : n + q + self.watched])
        first[:, n : n + q] += ctl.act[:, n : n + q]
        first[:, n + q :] += np.hstack([act @ of_states, np.eye(m)])
        made[self.first :] = np.tile(first, (self.pending, 1))
        return made

    def flow(self) -> Array:
        """The matrix of (z, p)' = flow (z, p) + (b, 0) held."""
        n, _, q = self.sizes
        whole = np.zeros((n + q, n + q))
        whole[:n, :n], whole[:n, n:] = self.a, self.b @ self.direct
        return whole

    def sources(self) -> Array:
        """How ρ_1 … ρ_n and the rates φ*_1' … φ*_q' enter (z, p)'. Shape (n + q, n + q)."""
        n, _, q = self.sizes
        entry = np.eye(n + q)
        entry[:n, n:] = self.steering
        return entry


def with_lags(stack: Stack, lags: tuple[int, ...]) -> Stack:
    """The stack with another state ζ for each row i of `lags`: ζ' = a_ii ζ + s_i, at zero at the start.

    Where M_i is (1 + δ)⁻¹ times what it counts as, z_i' = (1 + δ) s_i + …, and δ s_i acts as δ ζ_i would that is added
    to z_i wherever that is read: ζ has passed the lag itself, and is smaller than what s_i makes of measurement errors.
    """
    if not lags:
        return stack
    (n, _, _), own, count = stack.sizes, list(lags), len(lags)
    a = np.zeros((n + count, n + count))
    a[:n, :n], a[n:, :n], a[n:, n:] = stack.a, stack.a[own], np.diag(np.diag(stack.a)[own])
    ctl = stack.control
    wide = {key: np.insert(getattr(ctl, key), [n] * count, 0.0, axis=1) for key in Controller.__dataclass_fields__}
    wide["start"] = np.vstack([wide["start"], np.zeros((count, wide["start"].shape[1]))])
    steering = np.vstack([stack.steering, np.zeros((count, stack.steering.shape[1]))])
    return replace(
        stack, a=a, b=np.vstack([stack.b, stack.b[own]]), steering=steering, control=Controller(**wide), lags=lags
    )


def delay_of(delay: float, period: float) -> tuple[int, float]:
    """Whole periods and the share of one that a delay takes."""
    ratio = delay / period
    whole = int(ratio + AT_ONCE)
    share = ratio - whole
    return whole, share if share > AT_ONCE else 0.0


def wiring(model: LoopModel, own: Sequence[int]) -> tuple[Array, Array]:
    """Which states follow the demand of each network, and which inputs do. Shapes (n, q), (m, q)."""
    steering = np.array([[float(row.target == i) for i in own] for row in model.rows]).reshape(len(model.rows), -1)
    direct = np.array([[float(row == i) for i in own] for row in model.input_map]).reshape(len(model.input_map), -1)
    return steering, direct
