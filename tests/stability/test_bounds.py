"""Branch and bound against dense grids and closed forms."""

import math

import casadi as ca
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from stability import Interval, from_casadi
from stability.enclosures.bounds import range_of
from stability.enclosures.form import Form, Symbols, evaluate


def expression(build, count):
    z = ca.SX.sym("z", count)
    parts = [z[i] for i in range(count)]
    return from_casadi(ca.Function("f", [z], [ca.vertcat(build(*parts))]), tuple("xyz"[:count]))


CASES = {
    "six-hump camel": (lambda x, y: (4 - 2.1 * x**2 + x**4 / 3) * x**2 + x * y - 4 * y**2 + 4 * y**4, (-2, 2), (-1, 1)),
    "crane height": (lambda x, y: 1.6 * ca.sin(x) + 2.0 * ca.sin(x + y), (-0.2, 1.4), (-2.5, 0.0)),
    "tyre": (lambda x, y: y * ca.tanh(6 * x) * ca.exp(-(x**2)), (-1, 1), (0.2, 1)),
    "limits": (lambda x, y: ca.fmin(ca.fmax(x + y, -0.5), 0.7) * ca.fabs(x) + ca.cos(3 * y), (-1, 1), (-1, 1)),
}


@pytest.mark.parametrize("name", CASES)
def test_ranges_hold_the_values_of_a_grid_and_hardly_more(name):
    build, x, y = CASES[name]
    program = expression(build, 2)
    width = 1e-2
    found = range_of(program, {"x": Interval(*x), "y": Interval(*y)}, width=width)
    grid = np.meshgrid(np.linspace(*x, 301), np.linspace(*y, 301))
    z = ca.SX.sym("z", 2)
    values = np.array(ca.Function("f", [z], [build(z[0], z[1])]).map(grid[0].size)(np.array([g.ravel() for g in grid])))
    assert found.reached
    assert found.interval.low <= values.min() <= found.interval.low + width + 0.05
    assert found.interval.high - width - 0.05 <= values.max() <= found.interval.high


def test_the_known_minimum_of_the_camel():
    build, x, y = CASES["six-hump camel"]
    found = range_of(expression(build, 2), {"x": Interval(*x), "y": Interval(*y)}, width=1e-2)
    assert found.reached and -1.0316284 - 1e-2 <= found.interval.low <= -1.0316284


def test_a_limit_on_the_work_leaves_a_rigorous_bound_that_says_so():
    build, x, y = CASES["six-hump camel"]
    found = range_of(expression(build, 2), {"x": Interval(*x), "y": Interval(*y)}, width=1e-9, limit=200)
    assert not found.reached and found.interval.low < -1.0316 and found.boxes <= 410


@settings(max_examples=200)
@given(st.floats(-30, 30), st.floats(0, 8), st.floats(0, 1))
def test_elementary_ranges_hold_every_value(start, length, share):
    box = Interval(start, start + length)
    point = min(start + share * length, box.high)
    for name in ("sin", "cos", "exp", "abs"):
        exact = {"sin": math.sin, "cos": math.cos, "exp": math.exp, "abs": abs}[name](point)
        outer = getattr(box, name)()
        assert outer.low <= exact <= outer.high
    if length >= 2 * math.pi:
        assert box.sin() == Interval(-1, 1) == box.cos()


def test_the_sine_knows_its_peaks():
    assert Interval(1.5, 1.6).sin().high == 1.0 and Interval(1.5, 1.57).sin().high < 1.0
    assert Interval(4.7, 4.72).sin().low == -1.0 and Interval(-0.1, 0.1).cos().high == 1.0
    assert Interval(1e6, 1e6 + 0.1).sin() == Interval(-1, 1)
    assert Interval(800.0).exp().high == math.inf and math.isfinite(Interval(800.0).exp().low)


def test_a_divisor_that_can_vanish_is_an_error():
    with pytest.raises(ZeroDivisionError):
        range_of(expression(lambda x: 1 / x, 1), {"x": Interval(-1, 1)}, width=0.1)
    with pytest.raises(ValueError, match="must be positive"):
        range_of(expression(lambda x: x, 1), {"x": Interval(-1, 1)}, width=0.0)


def test_a_closed_loop_with_other_operations_is_refused_by_name():
    program = expression(lambda x: ca.sin(x), 1)
    symbols = Symbols(ranges={"a": Interval(-1, 1)})
    with pytest.raises(NotImplementedError, match="got sin"):
        evaluate(program, {"x": symbols.value("x", Form.of("a"))}, symbols)
