"""Expressions as data: a CasADi SX function turned into a list of operations that a file can carry."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, TypeVar

from .interval import Interval

T = TypeVar("T")


@dataclass(frozen=True, kw_only=True)
class Expression:
    """A straight-line program.

    Attributes:
        inputs: Names of the scalar inputs that occur.
        operations: Each entry is ("input", name), ("const", decimal text) or (operator, index…), where an index
            points to an earlier entry.
        outputs: Indices of the entries that are results.
    """

    inputs: tuple[str, ...]
    operations: tuple[tuple[Any, ...], ...]
    outputs: tuple[int, ...]

    def to_data(self) -> dict[str, Any]:
        """The expression as JSON data."""
        return {
            "inputs": list(self.inputs),
            "operations": [list(operation) for operation in self.operations],
            "outputs": list(self.outputs),
        }

    def reads(self, output: int) -> set[str]:
        """Names of the inputs that an entry depends on."""
        seen, fresh, found = {output}, [output], set()
        while fresh:
            operator, *arguments = self.operations[fresh.pop()]
            if operator == "input":
                found.add(arguments[0])
            elif operator != "const":
                fresh += [index for index in arguments if index not in seen]
                seen.update(arguments)
        return found

    def only(self, outputs: Sequence[int]) -> Expression:
        """The program of some entries alone."""
        kept, fresh = set(outputs), list(outputs)
        while fresh:
            operator, *arguments = self.operations[fresh.pop()]
            if operator not in ("input", "const"):
                fresh += [index for index in arguments if index not in kept]
                kept.update(arguments)
        place = {old: new for new, old in enumerate(sorted(kept))}
        made = []
        for old in sorted(kept):
            operator, *arguments = self.operations[old]
            plain = operator in ("input", "const")
            made.append((operator, *(arguments if plain else (place[index] for index in arguments))))
        read = tuple(operation[1] for operation in made if operation[0] == "input")
        return Expression(inputs=read, operations=tuple(made), outputs=tuple(place[index] for index in outputs))

    def joined(self, names: Sequence[str]) -> Expression:
        """The program with the quotients of two inputs that are named "A/B" as inputs of their own."""
        if not names:
            return self
        read = {k: operation[1] for k, operation in enumerate(self.operations) if operation[0] == "input"}
        made = []
        for operation in self.operations:
            name = "/".join(str(read.get(k, "")) for k in operation[1:]) if operation[0] == "div" else ""
            made.append(("input", name) if name in names else operation)
        return replace(self, inputs=(*self.inputs, *names), operations=tuple(made))

    def __call__(self, values: Mapping[str, float]) -> list[float]:
        """Evaluate in floats.

        Args:
            values: One number for each input name.

        Returns:
            The outputs, in order.
        """
        table = run(self, lambda name: float(values[name]), _FLOAT, float)
        return [table[index] for index in self.outputs]


def enclose(expression: Expression, ranges: Mapping[str, Interval]) -> list[Interval]:
    """Enclosures of the outputs over ranges of the inputs, by natural interval evaluation.

    Raises:
        ZeroDivisionError: a divisor can vanish in the ranges.
    """
    table = run(expression, ranges.__getitem__, BOUNDED, Interval)
    return [table[index] for index in expression.outputs]


BOUNDED: dict[str, Callable[..., Interval]] = {
    "add": lambda a, b: a + b,
    "sub": lambda a, b: a - b,
    "mul": lambda a, b: a * b,
    "div": lambda a, b: a / b,
    "neg": lambda a: -a,
    "sq": Interval.square,
    "sqrt": Interval.sqrt,
    "tanh": Interval.tanh,
    "sin": Interval.sin,
    "cos": Interval.cos,
    "exp": Interval.exp,
    "log": Interval.log,
    "asin": Interval.asin,
    "acos": Interval.acos,
    "atan": Interval.atan,
    "atan2": Interval.atan2,
    "abs": Interval.abs,
    "min": Interval.minimum,
    "max": Interval.maximum,
}


_FLOAT: dict[str, Callable[..., float]] = {
    "add": lambda a, b: a + b,
    "sub": lambda a, b: a - b,
    "mul": lambda a, b: a * b,
    "div": lambda a, b: a / b,
    "neg": lambda a: -a,
    "sq": lambda a: a * a,
    "sqrt": math.sqrt,
    "tanh": math.tanh,
    "sin": math.sin,
    "cos": math.cos,
    "exp": math.exp,
    "log": math.log,
    "asin": math.asin,
    "acos": math.acos,
    "atan": math.atan,
    "atan2": math.atan2,
    "abs": math.fabs,
    "min": lambda a, b: min(a, b),
    "max": lambda a, b: max(a, b),
}


def run(
    expression: Expression, read: Callable[[str], T], operators: Mapping[str, Callable[..., T]], const: Callable[..., T]
) -> list[T]:
    """Run the program in any arithmetic; returns the value of every entry.

    Raises:
        NotImplementedError: an operation that this arithmetic does not have; the message names it.
    """
    table: list[T] = []
    for operator, *arguments in expression.operations:
        if operator == "input":
            table.append(read(arguments[0]))
        elif operator == "const":
            table.append(const(float(arguments[0])))
        elif operator not in operators:
            raise NotImplementedError(
                f"this needs a model of {', '.join(operators)}: got {operator}; rewrite the model with those"
            )
        else:
            table.append(operators[operator](*(table[index] for index in arguments)))
    return table
