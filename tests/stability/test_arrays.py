"""Enclosures of many boxes against those of one box at a time, and against values."""

import casadi as ca
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from stability import Interval, enclose, enclose_many, from_casadi

X = ca.SX.sym("x", 3)
FORMULAS = {
    "polynomial": X[0] * X[1] - 3 * X[2] ** 2 + 1.5,
    "trigonometry": ca.sin(X[0] * X[1]) + ca.cos(X[2]) - ca.sin(X[0]) ** 2,
    "quotient": (X[0] - X[1]) / (X[2] ** 2 + 0.5),
    "root": ca.sqrt(X[0] ** 2 + X[1] ** 2 + 1e-3) * ca.tanh(X[2]),
    "exponential": ca.exp(-X[0]) + ca.fabs(X[1]),
    "angles": ca.atan2(X[0], X[1]) + ca.atan(X[2]),
    "inverses": ca.asin(ca.tanh(X[0])) - ca.acos(ca.cos(X[1])) + ca.log(ca.exp(X[2]) + 0.1),
    "extremes": ca.fmin(X[0], X[1]) - ca.fmax(X[1], X[2]),
}
NAMES = ("x", "y", "z")
ends = st.lists(st.tuples(st.floats(-4, 4), st.floats(0, 2)), min_size=3, max_size=3)


@pytest.mark.parametrize("formula", FORMULAS)
@settings(max_examples=60)
@given(boxes=st.lists(ends, min_size=1, max_size=5), shares=st.lists(st.floats(0, 1), min_size=3, max_size=3))
def test_it_holds_the_values_and_is_as_tight_as_one_box_at_a_time(formula, boxes, shares):
    function = ca.Function("f", [X], [FORMULAS[formula]])
    expression = from_casadi(function, NAMES)
    low = np.array([[start for start, _ in box] for box in boxes]).T
    high = np.array([[start + width for start, width in box] for box in boxes]).T
    lower, upper = enclose_many(expression, {name: (low[i], high[i]) for i, name in enumerate(NAMES)})
    for k in range(len(boxes)):
        one = enclose(expression, {name: Interval(low[i, k], high[i, k]) for i, name in enumerate(NAMES)})[0]
        room = 1e-12 * (1 + one.magnitude)
        assert one.low - room <= lower[0, k] <= one.low + room and one.high - room <= upper[0, k] <= one.high + room
        point = low[:, k] + np.array(shares) * (high[:, k] - low[:, k])
        assert lower[0, k] <= float(function(np.clip(point, low[:, k], high[:, k]))) <= upper[0, k]


def test_what_cannot_be_told_is_infinite():
    x = ca.SX.sym("x")
    for formula, box in ((1 / x, (-1.0, 1.0)), (ca.sqrt(x), (-1.0, 1.0)), (1 / x - 2 / x, (0.0, 1.0)),
        (ca.log(x), (0.0, 1.0)), (ca.asin(x), (0.5, 1.5)), (ca.acos(x), (-2.0, 0.0)),
    ):  # fmt: skip
        lower, upper = enclose_many(
            from_casadi(ca.Function("f", [x], [formula]), ("x",)), {"x": tuple(np.array([end]) for end in box)}
        )
        assert lower[0, 0] == -np.inf or upper[0, 0] == np.inf
        assert not np.isnan(lower).any() and not np.isnan(upper).any()


@given(st.floats(-1e6, 1e6), st.floats(0, 7))
def test_the_sine_knows_its_extremes(start, width):
    x = ca.SX.sym("x")
    both = from_casadi(ca.Function("f", [x], [ca.vertcat(ca.sin(x), ca.cos(x))]), ("x",))
    lower, upper = enclose_many(both, {"x": (np.array([start]), np.array([start + width]))})
    samples = np.linspace(start, start + width, 301)
    for row, values in enumerate((np.sin(samples), np.cos(samples))):
        assert lower[row, 0] <= values.min() and values.max() <= upper[row, 0]
        assert -1.0 <= lower[row, 0] and upper[row, 0] <= 1.0
