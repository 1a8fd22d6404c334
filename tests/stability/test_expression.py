from fractions import Fraction

import casadi as ca
import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from hdmm_opt.control import RAC
from hdmm_opt.plants import pmsm_emla
from stability import Interval, enclose, from_casadi
from stability.checking.arithmetic import WORK
from stability.checking.forms import Node, Table, derivative, linear
from stability.enclosures.form import Form, Symbols, evaluate, tangent


def function(build, count):
    z = ca.SX.sym("z", count)
    return ca.Function("f", [z], [ca.vertcat(*build(*(z[i] for i in range(count))))])


@pytest.mark.parametrize("level", ["torque", "voltage"])
def test_the_plant_as_data_equals_casadi(level):
    plant = pmsm_emla(level)
    model = RAC(plant=plant).loop_model()
    vector = ca.vertcat(plant.x, plant.u, plant.w, plant.p)
    names = (*plant.states, *plant.inputs, *plant.disturbances, *plant.parameters)
    reference = ca.Function("f", [vector], [ca.vertcat(plant.mass, plant.force)])
    random = np.random.default_rng(3)
    for _ in range(50):
        point = [
            *random.uniform(-1, 1, len(plant.states) + len(plant.inputs)),
            random.uniform(-8e4, 8e4),
            *plant.values().values(),
        ]
        expected = np.array(reference(point)).ravel()
        assert model.plant(dict(zip(names, point, strict=True))) == pytest.approx(expected, rel=1e-13)


def test_an_operation_that_cannot_be_bounded_is_named():
    with pytest.raises(NotImplementedError, match="the prover bounds"):
        from_casadi(function(lambda x: [ca.sinh(x)], 1), ("x",))


def test_unused_operations_and_inputs_are_left_out():
    expression = from_casadi(function(lambda x, y: [x + 1], 2), ("x", "y"))
    assert expression.inputs == ("x",)


@settings(max_examples=60)
@given(st.lists(st.floats(-3, 3), min_size=6, max_size=6), st.lists(st.floats(0, 1), min_size=3, max_size=3))
def test_enclosures_and_forms_hold_every_value(ends, shares):
    expression = from_casadi(
        function(lambda x, y, p: [p * x * y + ca.tanh(x - y) / (2 + y**2) - p * x, ca.sqrt(4 + x * x)], 3),
        ("x", "y", "p"),
    )
    boxes = {n: Interval(*sorted(ends[2 * k : 2 * k + 2])) for k, n in enumerate(("x", "y", "p"))}
    point = {n: b.low + s * (b.high - b.low) for (n, b), s in zip(boxes.items(), shares, strict=True)}
    natural = enclose(expression, boxes)
    symbols = Symbols(ranges={"a": boxes["x"], "b": boxes["y"]})
    inputs = {
        "x": symbols.value("x", Form.of("a")),
        "y": symbols.value("y", Form.of("b")),
        "p": symbols.constant(boxes["p"], "p"),
    }
    for exact, outer, value in zip(expression(point), natural, evaluate(expression, inputs, symbols), strict=True):
        assert outer.low - 1e-9 <= exact <= outer.high + 1e-9
        assert value.range.low - 1e-9 <= exact <= value.range.high + 1e-9
        form = symbols.expand(value.form)
        input_bound = form.constant + form.coefficient("a") * Interval(point["x"])
        input_bound = input_bound + form.coefficient("b") * Interval(point["y"])
        assert input_bound.low - 1e-9 <= exact <= input_bound.high + 1e-9


def test_what_the_law_cancels_cancels_in_the_form():
    """(R - R̂) i and (L - L̂) w i_d: products that plant and law share are one symbol."""
    expression = from_casadi(
        function(lambda i, w, r, r_hat, h, h_hat: [(r_hat * i + h_hat * (w * i)) - r * i - h * (w * i)], 6),
        ("i", "w", "r", "r_hat", "h", "h_hat"),
    )
    symbols = Symbols(ranges={"i": Interval(-50, 50), "w": Interval(-1000, 1000)})
    inputs = {name: symbols.value(name, Form.of(name)) for name in ("i", "w")}
    inputs |= {"r": symbols.constant(Interval(0.9, 1.1), "r"), "r_hat": symbols.constant(Interval(1.0), "")}
    inputs |= {"h": symbols.constant(Interval(0.002, 0.002), "h"), "h_hat": symbols.constant(Interval(0.002), "")}
    value = evaluate(expression, inputs, symbols)[0]
    assert value.range.magnitude == pytest.approx(0.1 * 50, rel=1e-9)


@settings(max_examples=60)
@given(st.lists(st.floats(-3, 3), min_size=4, max_size=4), st.lists(st.floats(0, 1), min_size=2, max_size=2))
def test_the_larger_of_two_is_one_of_them_or_lies_between(ends, shares):
    """Prover and checker, values and derivatives; where the ranges decide, the form is that of the larger alone."""
    expression = from_casadi(function(lambda x, y: [ca.fmax(2 * x - y, x) + y], 2), ("x", "y"))
    boxes = {n: Interval(*sorted(ends[2 * k : 2 * k + 2])) for k, n in enumerate(("x", "y"))}
    x, y = (b.low + s * (b.high - b.low) for b, s in zip(boxes.values(), shares, strict=True))
    exact = max(2 * x - y, x) + y
    a, b = Interval(2.0) * boxes["x"] - boxes["y"], boxes["x"]
    assume(min(abs(a.low - b.high), abs(b.low - a.high)) > 1e-6)  # where rounding decides, either is right
    symbols = Symbols(ranges=dict(boxes))
    (value,) = evaluate(expression, {n: symbols.value(n, Form.of(n)) for n in boxes}, symbols)
    form = symbols.expand(value.form)
    at = form.constant + form.coefficient("x") * Interval(x) + form.coefficient("y") * Interval(y)
    assert value.range.low - 1e-9 <= exact <= value.range.high + 1e-9
    assert at.low - 1e-9 <= exact <= at.high + 1e-9
    program = {"operations": [list(o) for o in expression.operations], "outputs": list(expression.outputs)}
    ranges = {n: (Fraction(b.low), Fraction(b.high)) for n, b in boxes.items()}
    WORK.begin(10**6)
    table = Table(ranges={"": (Fraction(1), Fraction(1)), **ranges})
    node = linear(
        program, {n: Node(table.key("input", n), {n: table.ranges[""]}, r) for n, r in ranges.items()}, table
    )[0]
    checked = {n: table.expand(node.form).get(n, (Fraction(0),) * 2) for n in boxes}
    for n in boxes:
        found = form.coefficient(n)
        assert found.low == pytest.approx(float(checked[n][0]), abs=1e-9)
        assert found.high == pytest.approx(float(checked[n][1]), abs=1e-9)
    slope = derivative(program, ranges, {"x": {"": table.ranges[""]}})[""]
    moved = tangent(expression, boxes, {"x": Form(constant=Interval(1.0))}).constant
    assert (moved.low, moved.high) == pytest.approx(tuple(map(float, slope)))
    assert slope[0] <= (2 if x > y else 1) <= slope[1]
    if a.low > b.high:
        assert checked["x"] == (2, 2) == slope and checked["y"] == (0, 0)


@settings(max_examples=40)
@given(st.floats(-2, 2), st.floats(-2, 2), st.floats(-1, 1), st.floats(-1, 1))
def test_tangent_holds_the_derivative(x, y, dx, dy):
    build = lambda a, b: [ca.tanh(a * b) / (3 + a**2) + ca.sqrt(5 + b) - a]  # noqa: E731
    expression = from_casadi(function(build, 2), ("x", "y"))
    z = ca.SX.sym("z", 2)
    jacobian = ca.Function("J", [z], [ca.jacobian(build(z[0], z[1])[0], z)])
    exact = float(np.array(jacobian([x, y])).ravel() @ [dx, dy])
    input_bound = tangent(
        expression,
        {"x": Interval(x), "y": Interval(y)},
        {n: Form(constant=Interval(v)) for n, v in (("x", dx), ("y", dy))},
    ).constant
    assert input_bound.low - 1e-12 <= exact <= input_bound.high + 1e-12
    assert input_bound.high - input_bound.low < 1e-9
