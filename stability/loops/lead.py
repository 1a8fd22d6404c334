"""Sections of lead on the error of an input's row: what a valve and a line put between an input and a speed.

Each section is (1 + a s)/(1 + f s) by backward differences over a period T (Åström and Wittenmark 1997, ch. 8),

    o = r e + (1 - r) w,   w <- p w + (1 - p) e,      r = (a + T)/(f + T),   p = f/(f + T)

and the next one gets o. Every w starts at zero; with a = f a section changes nothing.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ..enclosures.interval import Interval
from .ranges import Range

Array = NDArray[np.float64]


def shares(lead: Interval, smooth: Interval, period: float) -> tuple[Interval, Interval, Interval, Interval]:
    """r, 1 - r, p and 1 - p of a section.

    Args:
        lead: a, s.
        smooth: f, s.
        period: T, s.
    """
    every = smooth + Interval(period)
    return (lead + Interval(period)) / every, (smooth - lead) / every, smooth / every, Interval(period) / every


def sections(
    error: Range, lead: Interval, smooth: Interval, period: float, places: list[int]
) -> tuple[Range, list[Range]]:
    """What the last section gives, and every w after a sample.

    Args:
        error: What the first one gets, over all that the controller knows.
        lead: a, s.
        smooth: f, s.
        period: T, s.
        places: Where each w is in that.
    """
    direct, rest, kept, new = shares(lead, smooth, period)
    following = []
    for place in places:
        own = Range.of(np.eye(len(error.low))[place])
        following.append(own.times(kept) + error.times(new))
        error = error.times(direct) + own.times(rest)
    return error, following
