import math
from fractions import Fraction

import pytest
from hypothesis import given
from hypothesis import strategies as st

from stability import Interval, checker

numbers = st.floats(-1e6, 1e6, allow_nan=False).filter(lambda v: v == 0 or abs(v) > 1e-200)
pairs = st.tuples(numbers, numbers).map(sorted)
shares = st.floats(0, 1)


def inside(pair, share):
    low, high = pair
    return min(max(low + share * (high - low), low), high)


@given(pairs, pairs, shares, shares)
def test_operations_enclose_the_exact_result(a, b, s, t):
    x, y = inside(a, s), inside(b, t)
    left, right = Interval(*a), Interval(*b)
    exact = {"+": Fraction(x) + Fraction(y), "-": Fraction(x) - Fraction(y), "*": Fraction(x) * Fraction(y)}
    for operator, enclosure in (("+", left + right), ("-", left - right), ("*", left * right)):
        assert Fraction(enclosure.low) <= exact[operator] <= Fraction(enclosure.high)
    assert Fraction(left.square().low) <= Fraction(x) ** 2 <= Fraction(left.square().high)
    if not right.low <= 0 <= right.high:
        quotient = left / right
        assert Fraction(quotient.low) <= Fraction(x) / Fraction(y) <= Fraction(quotient.high)


@given(pairs, shares)
def test_tanh_and_sqrt_enclose(a, s):
    x = inside(a, s)
    assert Interval(*a).tanh().low <= math.tanh(x) <= Interval(*a).tanh().high
    low, high = (Fraction(v) for v in a)
    checker.WORK.begin(1000)
    lower, upper = checker.tanh((low, high))
    assert lower <= Fraction(math.tanh(x)) + Fraction(1, 2**50) and upper >= Fraction(math.tanh(x)) - Fraction(1, 2**50)
    if a[0] >= 0:
        root = Interval(*a).sqrt()
        assert Fraction(root.low) ** 2 <= Fraction(x) <= Fraction(root.high) ** 2 or root.low == 0.0
        below, above = checker.root(Fraction(x), False), checker.root(Fraction(x), True)
        assert below**2 <= Fraction(x) <= above**2


@given(st.fractions(-60, 60, max_denominator=10**6))
def test_exponential_encloses_and_is_tight(x):
    low, high = checker.exponential(x)
    assert 0 < low <= high
    assert high / low - 1 < Fraction(1, 2**60)
    assert float(low) * (1 - 1e-12) <= math.exp(float(x)) <= float(high) * (1 + 1e-12)


@given(st.fractions(), st.integers(1, 200))
def test_rounding_of_the_checker_goes_outwards(x, scale):
    value = x / 3**scale
    assert checker.down(value) <= value <= checker.up(value)
    if value:
        assert (checker.up(value) - checker.down(value)) / abs(value) <= Fraction(1, 2**90)


@pytest.mark.parametrize(("low", "high"), [(1.0, 0.0), (math.nan, 1.0), (0.0, math.nan)])
def test_refuses_ends_that_are_no_interval(low, high):
    with pytest.raises(ValueError, match="lower <= upper"):
        Interval(low, high)


def test_refuses_division_by_zero_and_root_of_negative():
    with pytest.raises(ZeroDivisionError):
        Interval(1.0) / Interval(-1.0, 1.0)
    with pytest.raises(ValueError, match="square root"):
        Interval(-1.0, 1.0).sqrt()
    with pytest.raises(checker.NotProvedError):
        checker.inverse((Fraction(-1), Fraction(1)))
    with pytest.raises(checker.NotProvedError):
        checker.root(Fraction(-1), True)
