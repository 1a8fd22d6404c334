"""Intervals on the fixed grid against fractions: they hold the exact range, and hardly more."""

import math
from fractions import Fraction

import pytest
from hypothesis import given
from hypothesis import strategies as st

from stability.checking.arithmetic import WORK, inverse, mul
from stability.checking.fixed import (
    SCALE,
    fixed_inverse,
    fixed_product,
    fixed_root,
    fixed_sincos,
    fixed_square,
    fixed_tanh,
    from_fixed,
    slopes,
    to_fixed,
)
from stability.checking.limits import NotProvedError

GRID = Fraction(1, 1 << SCALE)
#: What an enclosure of a function may be wider than the range.
WIDE = Fraction(1, 10**20)
numbers = st.fractions(-50, 50, max_denominator=10**6)
pairs = st.tuples(numbers, numbers).map(lambda p: (min(p), max(p)))


@pytest.fixture(autouse=True, scope="module")
def _plenty():
    WORK.begin(10**9)


def inside(inner, outer):
    return outer[0] <= inner[0] and inner[1] <= outer[1]


def exponential(x, terms=120):
    """e^x of a fraction with |x| <= 5, by its series; the rest is far below WIDE."""
    total, term = Fraction(1), Fraction(1)
    for k in range(1, terms):
        term = term * x / k
        total += term
    return total


def sine_and_cosine(x, terms=90):
    sums, term = [Fraction(1), Fraction(0)], Fraction(1)
    for k in range(1, terms):
        term = term * x / k
        sums[k % 2] += -term if k % 4 > 1 else term
    return sums[1], sums[0]


@given(a=pairs)
def test_rounding_goes_outwards_by_less_than_the_grid(a):
    back = from_fixed(to_fixed(a))
    assert inside(a, back) and a[0] - back[0] < GRID and back[1] - a[1] < GRID


@given(a=pairs, b=pairs)
def test_products_hold_those_of_the_fractions(a, b):
    exact, found = mul(a, b), from_fixed(fixed_product(to_fixed(a), to_fixed(b)))
    assert inside(exact, found)
    assert found[1] - found[0] <= exact[1] - exact[0] + 300 * GRID


@given(a=pairs)
def test_reciprocals_and_squares(a):
    square = from_fixed(fixed_square(to_fixed(a)))
    low, high = min(abs(a[0]), abs(a[1])), max(abs(a[0]), abs(a[1]))
    assert square[0] <= (0 if a[0] <= 0 <= a[1] else low**2) and high**2 <= square[1]
    if a[0] <= 0 <= a[1]:
        with pytest.raises(NotProvedError, match="divisor"):
            fixed_inverse(to_fixed(a))
    else:
        assert inside(inverse(a), from_fixed(fixed_inverse(to_fixed(a))))


@given(a=pairs)
def test_roots_squared_hold_their_argument(a):
    if a[0] < 0:
        with pytest.raises(NotProvedError, match="square root"):
            fixed_root(to_fixed((a[0] - 1, a[1])))
        return
    low, high = from_fixed(fixed_root(to_fixed(a)))
    assert low**2 <= a[0] and a[1] <= high**2


@given(a=st.tuples(st.fractions(-7, 7, max_denominator=1000), st.fractions(0, 3, max_denominator=1000)),
       share=st.fractions(0, 1, max_denominator=16))  # fmt: skip
def test_sines_and_cosines_hold_every_point_and_are_tight_at_one(a, share):
    low, high = a[0], a[0] + a[1]
    sines, cosines = (from_fixed(v) for v in fixed_sincos(to_fixed((low, high))))
    s, c = sine_and_cosine(low + share * (high - low))
    assert sines[0] <= s <= sines[1] and cosines[0] <= c <= cosines[1]
    if low == high:
        assert sines[1] - sines[0] < WIDE and cosines[1] - cosines[0] < WIDE


@given(a=st.tuples(st.fractions(-5, 5, max_denominator=1000), st.fractions(0, 3, max_denominator=1000)))
def test_tanh_holds_both_ends(a):
    low, high = a[0], min(a[0] + a[1], Fraction(5))
    found = from_fixed(fixed_tanh(to_fixed((low, high))))
    ends = [(e - 1) / (e + 1) for e in (exponential(2 * low), exponential(2 * high))]
    assert found[0] <= ends[0] and ends[1] <= found[1]
    assert found[0] >= ends[0] - WIDE and found[1] <= ends[1] + WIDE


def test_a_wild_angle_is_refused():
    with pytest.raises(NotProvedError, match="100 rad"):
        fixed_sincos(to_fixed((Fraction(101), Fraction(101))))


def test_slopes_are_the_derivatives_of_a_program():
    """f = sin(x y) / (2 + cos x), its gradient at one point against the formula."""
    program = {
        "inputs": ["x", "y"],
        "operations": [["input", "x"], ["input", "y"], ["mul", 0, 1], ["sin", 2], ["cos", 0], ["const", "2.0"],
                       ["add", 5, 4], ["div", 3, 6]],
        "outputs": [7],
    }  # fmt: skip
    x, y = Fraction(7, 10), Fraction(3, 2)
    one = (Fraction(1), Fraction(1))
    ((value, along),) = slopes(program, {"x": (x, x), "y": (y, y)}, {"x": {"x": one}, "y": {"y": one}})
    a, b = float(x), float(y)
    wanted = math.sin(a * b) / (2 + math.cos(a))
    by_x = (b * math.cos(a * b) + wanted * math.sin(a)) / (2 + math.cos(a))
    by_y = a * math.cos(a * b) / (2 + math.cos(a))
    for found, exact in ((value, wanted), (along["x"], by_x), (along["y"], by_y)):
        assert float(found[0]) == pytest.approx(exact, rel=1e-14) and found[1] - found[0] < WIDE
