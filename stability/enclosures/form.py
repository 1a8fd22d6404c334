"""Linear forms with interval coefficients: how the prover keeps track of which terms cancel.

A quantity is written as ``constant + sum(coefficient * symbol)``. Symbols are the errors Q_i, the proportional parts
K_i of the virtual controls, reference derivatives r_k, held errors e_k, and one symbol for each nonlinear operation.
A product or a tanh that occurs in both the plant and the law is one symbol, so that R·i - R̂·i becomes (R - R̂)·i.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, TypeVar

from .expression import Expression, run
from .interval import Interval, total

ZERO = Interval(0.0)
ONE = Interval(1.0)


class Form:
    """``constant + sum(coefficients[s] * s)``; immutable by convention."""

    __slots__ = ("coefficients", "constant")

    def __init__(self, coefficients: Mapping[str, Interval] | None = None, constant: Interval = ZERO) -> None:
        self.coefficients = dict(coefficients or {})
        self.constant = constant

    @staticmethod
    def of(symbol: str) -> Form:
        """The form that is one symbol."""
        return Form({symbol: ONE})

    @property
    def is_constant(self) -> bool:
        """True where no symbol occurs."""
        return not self.coefficients

    def __add__(self, other: Form) -> Form:
        merged = dict(self.coefficients)
        for symbol, value in other.coefficients.items():
            merged[symbol] = merged[symbol] + value if symbol in merged else value
        return Form(merged, self.constant + other.constant)

    def __neg__(self) -> Form:
        return Form({s: -c for s, c in self.coefficients.items()}, -self.constant)

    def __sub__(self, other: Form) -> Form:
        return self + -other

    def scaled(self, factor: Interval) -> Form:
        """The form times an interval."""
        return Form({s: factor * c for s, c in self.coefficients.items()}, factor * self.constant)

    def coefficient(self, symbol: str) -> Interval:
        """The coefficient of a symbol, zero where it does not occur."""
        return self.coefficients.get(symbol, ZERO)


@dataclass(frozen=True)
class Value:
    """A node of an expression: a key that equal operations share, its form, and its range."""

    key: int
    form: Form
    range: Interval


@dataclass
class Symbols:
    """The symbol table: ranges, and the forms that define derived symbols, oldest first."""

    ranges: dict[str, Interval] = field(default_factory=dict)
    definitions: dict[str, Form] = field(default_factory=dict)
    _named: dict[int, str] = field(default_factory=dict)
    _keys: dict[tuple[Any, ...], int] = field(default_factory=dict)

    def key(self, *operation: Any) -> int:
        """A number for an operation; the same for the same operator on the same arguments."""
        return self._keys.setdefault(operation, len(self._keys))

    def copy(self) -> Symbols:
        """A table of its own with the same symbols."""
        return Symbols(dict(self.ranges), dict(self.definitions), dict(self._named), dict(self._keys))

    def range_of(self, form: Form) -> Interval:
        """The range of a form over the ranges of its symbols."""
        return form.constant + total(c * self.ranges[s] for s, c in form.coefficients.items())

    def expand(self, form: Form, *, keep: str = "") -> Form:
        """Replace derived symbols by their definitions, newest first, except those that start with `keep`."""
        for symbol in reversed(self.definitions):
            if keep and symbol.startswith(keep):
                continue
            if symbol in form.coefficients:
                factor = form.coefficients[symbol]
                rest = Form({s: c for s, c in form.coefficients.items() if s != symbol}, form.constant)
                form = rest + self.definitions[symbol].scaled(factor)
        return form

    def node(self, key: int, definition: Form, bounds: Interval) -> Value:
        """The value of a nonlinear operation: a symbol of its own, shared by equal operations."""
        if key not in self._named:
            name = f"n{len(self._named)}"
            self._named[key] = name
            self.ranges[name] = bounds
            self.definitions[name] = definition
        return Value(key, Form.of(self._named[key]), bounds)

    def constant(self, bounds: Interval, name: str) -> Value:
        """An input that is a number or an uncertain parameter; equal numbers have equal keys."""
        key = self.key("const", bounds.low) if bounds.is_point else self.key("input", name)
        return Value(key, Form(constant=bounds), bounds)

    def value(self, name: str, form: Form) -> Value:
        """A named input with a given form."""
        return Value(self.key("input", name), form, self.range_of(form))


def evaluate(expression: Expression, inputs: Mapping[str, Value], symbols: Symbols) -> list[Value]:
    """Evaluate an expression in linear forms.

    Args:
        expression: The operations.
        inputs: A value for each input name.
        symbols: The table that receives the symbols of nonlinear operations.

    Returns:
        A value for each output. Its form holds for every combination of the symbols in their ranges.

    Raises:
        ZeroDivisionError: a divisor's range holds zero.
    """
    algebra = _Algebra(symbols)
    operators = {
        "add": algebra.add,
        "sub": algebra.sub,
        "mul": algebra.mul,
        "div": algebra.div,
        "neg": algebra.neg,
        "sq": lambda a: algebra.mul(a, a),
        "sqrt": lambda a: algebra.bounded("sqrt", a, a.range.sqrt()),
        "tanh": lambda a: algebra.bounded("tanh", a, a.range.tanh()),
        "max": algebra.larger,
    }

    def const(number: float) -> Value:
        return symbols.constant(Interval(number), "")

    table = run(expression, inputs.__getitem__, operators, const)
    return [table[index] for index in expression.outputs]


class _Algebra:
    def __init__(self, symbols: Symbols) -> None:
        self.symbols = symbols

    def _value(self, key: int, form: Form, natural: Interval) -> Value:
        return Value(key, form, natural & self.symbols.range_of(form))

    def add(self, a: Value, b: Value) -> Value:
        return self._value(self.symbols.key("add", *sorted((a.key, b.key))), a.form + b.form, a.range + b.range)

    def sub(self, a: Value, b: Value) -> Value:
        return self._value(self.symbols.key("sub", a.key, b.key), a.form - b.form, a.range - b.range)

    def neg(self, a: Value) -> Value:
        return self._value(self.symbols.key("neg", a.key), -a.form, -a.range)

    def mul(self, a: Value, b: Value) -> Value:
        key = self.symbols.key("mul", *sorted((a.key, b.key)))
        natural = a.range.square() if a.key == b.key else a.range * b.range
        if a.form.is_constant or b.form.is_constant:
            factor, form = (a.form.constant, b.form) if a.form.is_constant else (b.form.constant, a.form)
            return self._value(key, form.scaled(factor), natural)
        wide, narrow = (a, b) if a.range.magnitude >= b.range.magnitude else (b, a)
        if _outside(narrow.form) and not _outside(wide.form):
            wide, narrow = narrow, wide
        return self.symbols.node(key, narrow.form.scaled(wide.range), natural)

    def div(self, a: Value, b: Value) -> Value:
        key, form, natural = self.symbols.key("div", a.key, b.key), a.form.scaled(ONE / b.range), a.range / b.range
        return self._value(key, form, natural) if b.form.is_constant else self.symbols.node(key, form, natural)

    def larger(self, a: Value, b: Value) -> Value:
        """The larger of two: that one alone where the ranges decide, otherwise anything between both."""
        alone = _alone(a, b)
        if alone is not None:
            return alone
        between = b.form + (a.form - b.form).scaled(Interval(0.0, 1.0))
        return self.symbols.node(self.symbols.key("max", *sorted((a.key, b.key))), between, a.range.maximum(b.range))

    def bounded(self, operator: str, a: Value, bounds: Interval) -> Value:
        return self.symbols.node(self.symbols.key(operator, a.key), Form(constant=bounds), bounds)


def _outside(form: Form) -> bool:
    """Whether a form is of what comes from outside alone, a disturbance: it then scales the other factor."""
    return all(symbol[:2] in ("d:", "w:") for symbol in form.coefficients)


def tangent(expression: Expression, ranges: Mapping[str, Interval], tangents: Mapping[str, Form]) -> Form:
    """The directional derivative of the first output (forward differentiation).

    Args:
        expression: The operations.
        ranges: The range of each input, over which the partial derivatives are enclosed.
        tangents: The direction for the inputs that move; the others stand still.

    Returns:
        A form that encloses ``sum(d output / d input * tangent)`` over the ranges.
    """

    def read(name: str) -> _Dual:
        return _Dual(ranges[name], tangents.get(name, Form()))

    operators = {
        "add": lambda a, b: _Dual(a.range + b.range, a.tangent + b.tangent),
        "sub": lambda a, b: _Dual(a.range - b.range, a.tangent - b.tangent),
        "mul": lambda a, b: _Dual(a.range * b.range, a.tangent.scaled(b.range) + b.tangent.scaled(a.range)),
        "div": _dual_quotient,
        "neg": lambda a: _Dual(-a.range, -a.tangent),
        "sq": lambda a: _Dual(a.range.square(), a.tangent.scaled(Interval(2.0) * a.range)),
        "sqrt": lambda a: _Dual(a.range.sqrt(), a.tangent.scaled(Interval(0.5) / a.range.sqrt())),
        "tanh": lambda a: _Dual(a.range.tanh(), a.tangent.scaled(_tanh_slope(a.range))),
        "max": _dual_larger,
    }
    table = run(expression, read, operators, lambda number: _Dual(Interval(number), Form()))
    return table[expression.outputs[0]].tangent


@dataclass(frozen=True)
class _Dual:
    range: Interval
    tangent: Form


T = TypeVar("T", Value, _Dual)


def _dual_quotient(a: _Dual, b: _Dual) -> _Dual:
    ratio = a.range / b.range
    return _Dual(ratio, (a.tangent - b.tangent.scaled(ratio)).scaled(ONE / b.range))


def _alone(a: T, b: T) -> T | None:
    """The larger of two where their ranges decide which it is."""
    if a.range.low >= b.range.high:
        return a
    return b if b.range.low >= a.range.high else None


def _dual_larger(a: _Dual, b: _Dual) -> _Dual:
    alone = _alone(a, b)
    if alone is not None:
        return alone
    between = b.tangent + (a.tangent - b.tangent).scaled(Interval(0.0, 1.0))
    return _Dual(a.range.maximum(b.range), between)


def _tanh_slope(bounds: Interval) -> Interval:
    slope = ONE - bounds.tanh().square()
    return Interval(max(0.0, slope.low), min(1.0, slope.high))
