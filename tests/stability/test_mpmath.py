"""Enclosures of both arithmetics against mpmath in 60 digits: no value outside."""

import math
import random
from fractions import Fraction

import mpmath
import pytest

from stability import Interval, checker

mpmath.mp.dps = 60
ONE_ARGUMENT = {
    "tanh": (mpmath.tanh, -30.0, 30.0), "sqrt": (mpmath.sqrt, 0.0, 1e6), "sin": (mpmath.sin, -50.0, 50.0),
    "cos": (mpmath.cos, -50.0, 50.0), "exp": (mpmath.exp, -50.0, 50.0), "log": (mpmath.log, 1e-6, 1e6),
    "asin": (mpmath.asin, -1.0, 1.0), "acos": (mpmath.acos, -1.0, 1.0), "atan": (mpmath.atan, -1e3, 1e3),
}  # fmt: skip


def exact(x):
    """A float or a fraction as an mpmath number."""
    return mpmath.mpf(x.numerator) / x.denominator if isinstance(x, Fraction) else mpmath.mpf(x)


def drawn(random_, low, high):
    """A range inside an interval, of any width down to nothing, and a point of it."""
    centre = random_.uniform(low, high) * 10.0 ** random_.choice((0, 0, -3, -9))
    centre = min(max(centre, low), high)
    width = (high - low) * 10.0 ** random_.uniform(-14, -0.5)
    a, b = max(low, centre - width), min(high, centre + width)
    return (a, b), random_.choice((a, b, random_.uniform(a, b)))


def missed(seed, count):
    """How many of so many values lie outside their enclosures, in the prover's and in the checker's arithmetic."""
    random_, wrong = random.Random(seed), 0
    checker.WORK.begin(10**9)
    for _ in range(count):
        name = random_.choice((*ONE_ARGUMENT, "mul", "div", "atan2", "exponential"))
        if name in ONE_ARGUMENT:
            function, low, high = ONE_ARGUMENT[name]
            (a, b), x = drawn(random_, low, high)
            value = function(mpmath.mpf(x))
            found = getattr(Interval(a, b), name)()
            wrong += not mpmath.mpf(found.low) <= value <= mpmath.mpf(found.high)
            bounds = own(name, Fraction(a), Fraction(b))
            wrong += bounds is not None and not exact(bounds[0]) <= value <= exact(bounds[1])
        elif name == "atan2":
            (a, b), y = drawn(random_, -1e3, 1e3)
            (c, d), x = drawn(random_, -1e3, 1e3)
            found = Interval(a, b).atan2(Interval(c, d))
            wrong += not mpmath.mpf(found.low) <= mpmath.atan2(mpmath.mpf(y), mpmath.mpf(x)) <= mpmath.mpf(found.high)
        elif name == "exponential":
            x = Fraction(random_.uniform(-60, 60))
            low, high = checker.exponential(x)
            wrong += not exact(low) <= mpmath.exp(exact(x)) <= exact(high)
        else:
            (a, b), x = drawn(random_, -1e3, 1e3)
            (c, d), y = drawn(random_, 1e-3, 1e3)
            value = mpmath.mpf(x) * mpmath.mpf(y) if name == "mul" else mpmath.mpf(x) / mpmath.mpf(y)
            found = Interval(a, b) * Interval(c, d) if name == "mul" else Interval(a, b) / Interval(c, d)
            wrong += not mpmath.mpf(found.low) <= value <= mpmath.mpf(found.high)
            second = (Fraction(c), Fraction(d))
            second = second if name == "mul" else checker.inverse(second)
            low, high = checker.mul((Fraction(a), Fraction(b)), second)
            wrong += not exact(low) <= value <= exact(high)
    return wrong


def own(name, a, b):
    """The checker's enclosure; None where it has none."""
    if name == "tanh":
        return checker.tanh((a, b))
    if name == "sqrt":
        return checker.root(a, False), checker.root(b, True)
    if name in ("sin", "cos"):
        found = checker.fixed_sincos(checker.to_fixed((a, b)))
        return checker.from_fixed(found[0 if name == "sin" else 1])
    return None


def test_no_enclosure_misses_its_value():
    assert missed(1, 3_000) == 0


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(2, 10))
def test_no_enclosure_misses_its_value_at_length(seed):
    """80,000 more."""
    assert missed(seed, 10_000) == 0


def test_the_count_would_notice_a_miss(monkeypatch):
    monkeypatch.setattr(checker, "tanh", lambda a: (a[0] * 0, a[0] * 0))
    assert missed(1, 300) > 0 and math.isfinite(missed(1, 10))
