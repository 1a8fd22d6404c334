"""A straight-line program written out as instructions."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

from stability.enclosures.expression import Expression

from .instructions import Assembler

#: How soon a value is known: constants, a run's constants, a tick's, an integration step's.
_LEVEL = {"f": 1, "s": 2, "l": 2, "v": 2, "z": 2, "t": 2, "x": 3, "d": 3}

_COMPARISONS = {"lt": "olt", "le": "ole", "eq": "oeq", "ne": "une"}
_LIBRARY = ("log", "pow", "tan", "asin", "acos", "atan", "atan2", "sinh", "cosh")


def inline(out: Assembler, program: Expression, known: Mapping[str, str], *, quick: bool) -> list[str]:
    """Write a straight-line program.

    A product that is used once is fused into a sum, unless the other term is a product too: a² - b² stays zero where
    a = b. Where `quick`, a division by what is constant in a run becomes a product with the reciprocal, which leaves
    the loops; that costs an ulp, which a rate that is integrated does not show.
    """
    operations = program.operations
    uses = [0] * len(operations)
    for operator, *arguments in operations:
        if operator not in ("input", "const"):
            for index in arguments:
                uses[index] += 1
    for index in program.outputs:
        uses[index] += 1
    names: list[str] = []
    levels: list[int] = []

    def fused(operator: str, first: int, second: int) -> str | None:
        if operator not in ("add", "sub") or (_product(operations, first) and _product(operations, second)):
            return None
        for index, other in ((second, first), (first, second)):
            kind, *factors = operations[index]
            if kind in ("mul", "sq") and uses[index] == 1:
                a, b, c = names[factors[0]], names[factors[-1]], names[other]
                if operator == "sub" and index == second:
                    return out.fma(out.neg(a), b, c)
                return out.fma(a, b, out.neg(c) if operator == "sub" else c)
        return None

    for operator, *arguments in operations:
        if operator == "input":
            names.append(known[arguments[0]])
            levels.append(_LEVEL[arguments[0][0]])
            continue
        if operator == "const":
            names.append(out.const(float(arguments[0])))
            levels.append(0)
            continue
        levels.append(max((levels[i] for i in arguments), default=0))
        given = [names[i] for i in arguments]
        whole = fused(operator, arguments[0], arguments[1]) if len(arguments) == 2 else None
        if whole is not None:
            names.append(whole)
        elif quick and operator == "div" and levels[arguments[1]] == _LEVEL["f"] < levels[arguments[0]]:
            names.append(out.mul(given[0], out.div(out.const(1.0), given[1])))
        else:
            names.append(_operation(out, operator, given))
    return [names[index] for index in program.outputs]


def _product(operations: tuple[tuple[Any, ...], ...], index: int) -> bool:
    """Whether a value is a product, with or without a sign."""
    operator, *arguments = operations[index]
    return operator in ("mul", "sq") or (operator == "neg" and _product(operations, arguments[0]))


def _operation(out: Assembler, operator: str, names: list[str]) -> str:
    simple: dict[str, Callable[..., str]] = {
        "add": out.add, "sub": out.sub, "mul": out.mul, "div": out.div, "neg": out.neg,
        "sq": lambda a: out.mul(a, a),
        "sqrt": lambda a: out.intrinsic("sqrt", a), "abs": lambda a: out.intrinsic("fabs", a),
        "floor": lambda a: out.intrinsic("floor", a), "ceil": lambda a: out.intrinsic("ceil", a),
        "copysign": lambda a, b: out.intrinsic("copysign", a, b),
        "exp": out.exp, "tanh": out.tanh, "sin": out.sin, "cos": out.cos,
        "min": lambda a, b: out.intrinsic("minnum", a, b), "max": lambda a, b: out.intrinsic("maxnum", a, b),
        "not": lambda a: _truth(out, "oeq", a, out.const(0.0)),
        "and": lambda a, b: _truth(out, "une", out.mul(_unit(out, a), _unit(out, b)), out.const(0.0)),
        "or": lambda a, b: _truth(out, "une", out.add(_unit(out, a), _unit(out, b)), out.const(0.0)),
        "if_else_zero": lambda c, a: out.select(out.compare("une", c, out.const(0.0)), a, out.const(0.0)),
        "sign": out.sign,
    }  # fmt: skip
    if operator in _COMPARISONS:
        return _truth(out, _COMPARISONS[operator], *names)
    if operator in _LIBRARY:
        return out.library(operator, *names)
    if operator not in simple:
        raise NotImplementedError(f"the loop compiler does not know {operator}; rewrite the model without it")
    return simple[operator](*names)


def _truth(out: Assembler, condition: str, a: str, b: str) -> str:
    return out.select(out.compare(condition, a, b), out.const(1.0), out.const(0.0))


def _unit(out: Assembler, a: str) -> str:
    """1 where a is nonzero, else 0."""
    return _truth(out, "une", a, out.const(0.0))
