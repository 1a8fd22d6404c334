"""The exact maps of one control period of a stack, on a grid of sub-steps that holds the switch of the input."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from .stack import Stack

Array = NDArray[np.float64]


@dataclass(frozen=True, kw_only=True)
class Turn:
    """A period of a stack on a grid of sub-steps that holds the switch of the input.

    Columns are over Z, then pulses on the new inputs, on the networks, on the leads and on ẑ of an observer, kicks of
    jitter, and measurement errors of the states.

    Attributes:
        steps: Length of each sub-step, s.
        begin: (z, p) at the start of each sub-step. Shape (steps, n + q, columns).
        end: The same at the end of each.
        held: The input that acts in each sub-step. Shape (steps, m, columns).
        image: Z at the next sample. Shape (order, columns).
        fold: How (z, p) at the end of a period enters Z. Shape (order, n + q).
        shown: c, w of the leads and what is bounded of an observer, at a sample; how much the input changes that acts
            in this period. Shape (q + l, and 3 with an observer, and m with jitter, columns).
    """

    steps: Array
    begin: Array
    end: Array
    held: Array
    image: Array
    fold: Array
    shown: Array


def turn(stack: Stack, count: int) -> Turn:
    """The exact maps of a period with about so many sub-steps."""
    from scipy.linalg import expm

    n, m, q = stack.sizes
    order, waiting, watched, ctl = stack.order, stack.pending, stack.watched, stack.control
    columns, first, filters = order + stack.pulses + n, stack.first, stack.leads
    unit = np.eye(columns)
    pulse, learn, smooth, astray, kick, noise = np.split(
        unit[order:], np.cumsum((m, q, filters, watched, stack.kicked))
    )
    of_states, of_observer = stack.seen()
    seen = of_states @ (unit[:n] + noise) + of_observer @ unit[n + q : n + q + watched]
    seen[:watched] += astray
    networks, remembered = unit[n : n + q], unit[first - filters : first]
    known = np.vstack([seen, networks, remembered])
    fresh = pulse + ctl.act @ known

    def waited(k: int) -> Array:
        """The input computed k samples ago."""
        if k == 0:
            return fresh
        return unit[first + m * (k - 1) : first + m * k]

    before = [(stack.share, waited(stack.whole + 1), False)] if stack.share > 0 else []
    parts = [*before, (1 - stack.share, waited(stack.whole), bool(stack.kicked))]
    flow = stack.flow()
    block = np.zeros((n + q + m, n + q + m))
    block[: n + q, : n + q], block[:n, n + q :] = flow, stack.b
    x = np.eye(n + q, columns)
    x[n:] = 0.0
    steps, begin, end, acting = [], [], [], []
    for share, held, switched in parts:
        if switched:
            x = np.vstack([x[:n] + kick, x[n:]])
        pieces = max(1, round(count * share))
        length = share * stack.period / pieces
        forward = np.asarray(expm(block * length))
        for _ in range(pieces):
            begin.append(x)
            x = forward[: n + q, : n + q] @ x + forward[: n + q, n + q :] @ held
            steps.append(length)
            end.append(x)
            acting.append(held)
    fold = np.zeros((order, n + q))
    fold[:n, :n] = np.eye(n)
    fold[n : n + q, n:] = -np.eye(q)
    for k in range(waiting):
        fold[first + m * k : first + m * (k + 1), n:] = stack.direct
    image = fold @ x
    image[n : n + q] += learn + ctl.learn @ known
    image[n + q : n + q + watched] += stack.ahead[:watched] @ seen[:2] if watched else 0.0
    image[first - filters : first] += smooth + ctl.smooth @ known
    for k in range(waiting):
        image[first + m * k : first + m * (k + 1)] += waited(k)
    of_observer = [(seen - unit[:n])[:2], (unit[0] + noise[0] - unit[n + q])[None]] if watched else []
    changes = waited(stack.whole) - waited(stack.whole + 1) if stack.turned else unit[:0]
    shown = np.vstack([networks, remembered, *of_observer, changes])
    return Turn(
        steps=np.array(steps), begin=np.array(begin), end=np.array(end), held=np.array(acting), image=image, fold=fold,
        shown=shown
    )  # fmt: skip
