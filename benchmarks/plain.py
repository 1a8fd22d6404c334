"""CasADi functions as plain Python arithmetic, so that programs that call back into Python are not charged for CasADi."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import casadi as ca

from stability.enclosures.translation import straight_line

_BINARY = {"add": "+", "sub": "-", "mul": "*", "div": "/"}
_COMPARED = {"lt": "<", "le": "<=", "eq": "==", "ne": "!="}
_NAMED = {"sqrt", "tanh", "sin", "cos", "exp", "tan", "asin", "acos", "atan", "atan2", "floor", "ceil", "copysign"}


def plain(inputs: Sequence[ca.SX], output: ca.SX) -> Callable[[Sequence[float]], list[float]]:
    """An expression of some symbols as a function of all of them in one list."""
    flat = ca.vertcat(*inputs)
    names = tuple(f"v{k}" for k in range(flat.numel()))
    program = straight_line(ca.Function("f", [flat], [ca.densify(output)], {"cse": True}), names)
    lines = ["def f(v):"]
    for k, (operator, *arguments) in enumerate(program.operations):
        lines.append(f"  t{k} = {_text(operator, arguments)}")
    lines.append(f"  return [{', '.join(f't{k}' for k in program.outputs)}]")
    space: dict = {}
    exec("from math import *\n" + "\n".join(lines), space)
    return space["f"]


def _text(operator: str, arguments: Sequence) -> str:
    if operator == "input":
        return f"v[{arguments[0][1:]}]"
    if operator == "const":
        return arguments[0]
    a, *rest = (f"t{k}" for k in arguments)
    if operator in _BINARY:
        return f"{a} {_BINARY[operator]} {rest[0]}"
    if operator in _COMPARED:
        return f"float({a} {_COMPARED[operator]} {rest[0]})"
    if operator in _NAMED:
        return f"{operator}({', '.join([a, *rest])})"
    return {
        "neg": f"-{a}", "sq": f"{a} * {a}", "abs": f"fabs({a})", "sign": f"({a} > 0) - ({a} < 0.0)",
        "not": f"float(not {a})", "min": f"min({a}, {rest[:1] and rest[0]})", "max": f"max({a}, {rest[:1] and rest[0]})",
        "and": f"float(bool({a} and {rest[:1] and rest[0]}))", "or": f"float(bool({a} or {rest[:1] and rest[0]}))",
        "if_else_zero": f"({rest[:1] and rest[0]} if {a} else 0.0)",
    }[operator]  # fmt: skip
