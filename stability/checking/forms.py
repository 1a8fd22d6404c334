"""Linear forms with interval coefficients: what plant and law share cancels.

Theorem: affine forms with a symbol for each nonlinear value (Stolfi and de Figueiredo 1997); derivatives by the
chain rule. Must fail: an operation list that reads what is not there, a sign or a term of it changed.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from fractions import Fraction
from typing import Any

from .arithmetic import ONE, WORK, ZERO, Interval, add, intersect, inverse, magnitude, mul, neg, root, square, tanh

Form = dict[str, Interval]


def plus(*forms: Form) -> Form:
    """Sum of forms."""
    result: Form = {}
    for form in forms:
        WORK.one(len(form) // 8)
        for symbol, value in form.items():
            result[symbol] = add(result[symbol], value) if symbol in result else value
    return result


def over(form: Form, ranges: dict[str, Interval]) -> Interval:
    """Range of a form over ranges of its symbols."""
    total = ZERO
    for symbol, value in form.items():
        total = add(total, mul(value, ranges[symbol]))
    return total


def times(form: Form, factor: Interval) -> Form:
    """A form scaled by an interval."""
    return {symbol: mul(value, factor) for symbol, value in form.items()}


@dataclass(frozen=True)
class Node:
    """Value of an operation: identity (equal operations share one), form and range."""

    key: int
    form: Form
    range: Interval


@dataclass
class Table:
    """Ranges of all symbols, definitions of the derived ones, oldest first, and how many maxima no range decides."""

    ranges: dict[str, Interval] = field(default_factory=lambda: {"": ONE})
    definitions: dict[str, Form] = field(default_factory=dict)
    names: dict[int, str] = field(default_factory=dict)
    keys: dict[tuple[Any, ...], int] = field(default_factory=dict)
    undecided: int = 0

    def key(self, *operation: Any) -> int:
        """A number for an operation; the same for the same operator on the same arguments."""
        return self.keys.setdefault(operation, len(self.keys))

    def copy(self) -> Table:
        """A table of its own with the same symbols."""
        return Table(dict(self.ranges), dict(self.definitions), dict(self.names), dict(self.keys), self.undecided)

    def over(self, form: Form) -> Interval:
        """Range of a form."""
        return over(form, self.ranges)

    def node(self, key: int, form: Form, natural: Interval) -> Node:
        """A value whose range is the better of two enclosures."""
        return Node(key, form, intersect(natural, self.over(form)))

    def fresh(self, key: int, definition: Form, natural: Interval) -> Node:
        """A nonlinear value: a symbol of its own, the same for the same operation."""
        if key not in self.names:
            name = self.names[key] = f"n{len(self.names)}"
            self.ranges[name], self.definitions[name] = natural, definition
        return Node(key, {self.names[key]: ONE}, natural)

    def expand(self, form: Form, keep: str = "#") -> Form:
        """Replace derived symbols by their definitions, newest first."""
        for symbol in reversed(list(self.definitions)):
            if symbol in form and not symbol.startswith(keep):
                WORK.one(len(form) // 8)
                rest = {s: v for s, v in form.items() if s != symbol}
                form = plus(rest, times(self.definitions[symbol], form[symbol]))
        return form


def walk(
    program: dict[str, Any], read: Callable[[str], Any], const: Callable[[Fraction], Any], apply: Any
) -> list[Any]:
    """Run an operation list in any arithmetic; returns every entry."""
    table: list[Any] = []
    WORK.one(len(program["operations"]) // 64)
    for name, *arguments in program["operations"]:
        if name == "input":
            table.append(read(arguments[0]))
        elif name == "const":
            table.append(const(Fraction(arguments[0])))
        else:
            table.append(apply(name, *(table[i] for i in arguments)))
    return table


def linear(program: dict[str, Any], inputs: dict[str, Node], table: Table) -> list[Node]:
    """Outputs of an operation list in linear forms."""

    def const(value: Fraction) -> Node:
        return Node(table.key("const", value), {"": (value, value)}, (value, value))

    def apply(operator: str, a: Node, b: Node | None = None) -> Node:
        arguments = [a.key] if b is None else [a.key, b.key]
        key = table.key(operator, *(arguments if operator in ("sub", "div") else sorted(arguments)))
        if operator == "neg":
            return table.node(key, times(a.form, (Fraction(-1), Fraction(-1))), neg(a.range))
        if operator == "tanh":
            return table.fresh(key, {"": tanh(a.range)}, tanh(a.range))
        if operator == "sqrt":
            bounds = root(a.range[0], False), root(a.range[1], True)
            return table.fresh(key, {"": bounds}, bounds)
        if b is None:
            return multiply(table.key("mul", a.key, a.key), a, a)
        if operator == "add":
            return table.node(key, plus(a.form, b.form), add(a.range, b.range))
        if operator == "sub":
            return table.node(key, plus(a.form, times(b.form, neg(ONE))), add(a.range, neg(b.range)))
        if operator == "max":
            if apart(a.range, b.range):
                return a if a.range[0] >= b.range[1] else b
            table.undecided += 1
            return table.fresh(key, between(a.form, b.form), greater(a.range, b.range))
        if operator == "div":
            form, natural = times(a.form, inverse(b.range)), mul(a.range, inverse(b.range))
            return (table.node if set(b.form) <= {""} else table.fresh)(key, form, natural)
        return multiply(key, a, b)

    def multiply(key: int, a: Node, b: Node) -> Node:
        natural = square(a.range) if a.key == b.key else mul(a.range, b.range)
        for one, other in ((a, b), (b, a)):
            if set(one.form) <= {""}:
                return table.node(key, times(other.form, one.form.get("", ZERO)), natural)
        wide, narrow = (a, b) if magnitude(a.range) >= magnitude(b.range) else (b, a)
        if outside(narrow.form) and not outside(wide.form):
            wide, narrow = narrow, wide
        return table.fresh(key, times(narrow.form, wide.range), natural)

    entries = walk(program, inputs.__getitem__, const, apply)
    return [entries[i] for i in program["outputs"]]


def greater(a: Interval, b: Interval) -> Interval:
    """Range of the larger of two numbers."""
    return max(a[0], b[0]), max(a[1], b[1])


def apart(a: Interval, b: Interval) -> bool:
    """Whether ranges decide which of two numbers is the larger."""
    return a[0] >= b[1] or b[0] >= a[1]


def between(a: Form, b: Form) -> Form:
    """All forms between two: max(a, b) = b + s (a - b) with s from 0 to 1."""
    return plus(b, times(plus(a, times(b, neg(ONE))), (Fraction(0), Fraction(1))))


def outside(form: Form) -> bool:
    """Whether a form is of what comes from outside alone, a disturbance: it then scales the other factor."""
    return all(symbol[:2] in ("", "d:", "w:") for symbol in form)


def derivative(program: dict[str, Any], ranges: dict[str, Interval], tangents: dict[str, Form]) -> Form:
    """Directional derivative of the first output, enclosed over the ranges of the inputs."""
    two = (Fraction(2), Fraction(2))

    def apply(operator: str, a: tuple[Interval, Form], b: tuple[Interval, Form] | None = None) -> Any:
        (x, dx), (y, dy) = a, b if b is not None else a
        if operator == "neg":
            return neg(x), times(dx, neg(ONE))
        if operator == "tanh":
            value = tanh(x)
            slope = add(ONE, neg(square(value)))
            return value, times(dx, (max(slope[0], Fraction(0)), min(slope[1], Fraction(1))))
        if operator == "sqrt":
            value = root(x[0], False), root(x[1], True)
            return value, times(dx, inverse(mul(two, value)))
        if operator == "sq":
            return square(x), times(dx, mul(two, x))
        if operator == "add":
            return add(x, y), plus(dx, dy)
        if operator == "sub":
            return add(x, neg(y)), plus(dx, times(dy, neg(ONE)))
        if operator == "mul":
            return mul(x, y), plus(times(dx, y), times(dy, x))
        if operator == "max":
            if apart(x, y):
                return (x, dx) if x[0] >= y[1] else (y, dy)
            return greater(x, y), between(dx, dy)
        ratio = mul(x, inverse(y))
        return ratio, times(plus(dx, times(dy, neg(ratio))), inverse(y))

    entries = walk(program, lambda n: (ranges[n], tangents.get(n, {})), lambda c: ((c, c), {}), apply)
    return entries[program["outputs"][0]][1]
