"""Sections of lead between the error of an input's row and its proportional part.

Theorem: o = r e + (1 - r) w and w <- p w + (1 - p) e with r = (a + T)/(f + T), p = f/(f + T) are backward differences
of (1 + a s)/(1 + f s). Must fail: other times, a section less, a state that is left out.
"""

from __future__ import annotations

from fractions import Fraction

from .arithmetic import Interval, add, inverse, mul, neg
from .claim import Gain


def sections(
    error: list[Interval], gain: Gain, period: Fraction, places: list[int]
) -> tuple[list[Interval], list[list[Interval]]]:
    """What the last section gives, and what each w is at the next sample, over all that the controller knows."""
    every = inverse(_more(gain.smooth, period))
    direct, rest = mul(_more(gain.lead, period), every), mul(add(gain.smooth, neg(gain.lead)), every)
    kept, new, following = mul(gain.smooth, every), mul((period, period), every), []
    for place in places:
        following.append([mul(v, new) for v in error])
        following[-1][place] = add(following[-1][place], kept)
        error = [mul(v, direct) for v in error]
        error[place] = add(error[place], rest)
    return error, following


def _more(time: Interval, period: Fraction) -> Interval:
    return time[0] + period, time[1] + period
