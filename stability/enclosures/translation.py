"""From CasADi functions to operations, and to operations that the checker knows."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from typing import Any

from .expression import BOUNDED, Expression

#: Further CasADi operations: programs may hold them, the prover does not bound them.
_UNBOUNDED = (
    "lt", "le", "eq", "ne", "not", "and", "or", "if_else_zero", "sign", "copysign", "floor", "ceil", "pow",
    "tan", "sinh", "cosh",
)  # fmt: skip


def from_casadi(function: Any, names: tuple[str, ...]) -> Expression:
    """Read the instruction list of a CasADi SX function that the prover is to bound.

    Args:
        function: A `casadi.Function` over SX with one column vector as its single input and one as its output.
        names: A name for each element of the input.

    Returns:
        The same function as data, common subexpressions shared.

    Raises:
        NotImplementedError: an instruction that the prover cannot bound; the message names it.
        ValueError: the number of names does not match the input.
    """
    program = straight_line(function, names)
    for operator, *_ in program.operations:
        if operator not in BOUNDED and operator not in ("input", "const"):
            raise NotImplementedError(
                f"the prover bounds + - * / {' '.join(list(BOUNDED)[5:])}: {operator} came in "
                f"{function.name()}; rewrite the model with those"
            )
    return program


def straight_line(function: Any, names: tuple[str, ...]) -> Expression:
    """Read any CasADi SX function, also one with comparisons and functions that the prover does not bound.

    Args:
        function: As for `from_casadi`.
        names: A name for each element of the input.

    Raises:
        NotImplementedError: an instruction that is not known here; the message names it.
        ValueError: the number of names does not match the input.
    """
    import casadi as ca

    dense = function.n_in() == 1 and function.nnz_in(0) == function.numel_in(0) == len(names)
    if not dense or function.n_out() != 1:
        raise ValueError(f"one dense input vector with {len(names)} named elements is needed: got {function}")
    # an output instruction counts the nonzeros of the output, column by column
    row, column = function.sparsity_out(0).get_triplet()
    places = [i + j * function.size1_out(0) for i, j in zip(row, column, strict=True)]
    known = _casadi_operators(ca)
    builder = _Builder()
    work: dict[int, int] = {}
    results: dict[int, int] = {}
    for k in range(function.n_instructions()):
        code = function.instruction_id(k)
        sources, targets = function.instruction_input(k), function.instruction_output(k)
        if code == ca.OP_INPUT:
            work[targets[0]] = builder.add("input", names[sources[1]])
        elif code == ca.OP_CONST:
            work[targets[0]] = builder.const(function.instruction_constant(k))
        elif code == ca.OP_OUTPUT:
            results[places[targets[1]]] = work[sources[0]]
        elif code in known:
            work[targets[0]] = known[code](builder, *(work[i] for i in sources))
        else:
            raise NotImplementedError(
                f"CasADi instruction {code} came in {function.name()}; rewrite the model without it"
            )
    outputs = tuple(results[i] if i in results else builder.const(0.0) for i in range(function.numel_out(0)))
    return _pruned(builder.operations, outputs)


def algebraic(expression: Expression) -> Expression:
    """The same function without arc cosines, where they occur inside sines and cosines alone.

    With φ = ±acos(u) + k, cos φ = u cos k ∓ √(1 - u²) sin k and sin φ = ±√(1 - u²) cos k + u sin k: a linear actuator
    across a joint enters its dynamics through such angles. What is left has the operations that `checker.py` knows.

    Raises:
        ValueError: an angle is used otherwise.
    """
    builder = _Builder()
    moved: list[int] = []
    angles: dict[int, tuple[int, float, float]] = {}  # entry -> (u, sign, k)
    numbers: dict[int, float] = {}
    for index, (operator, *arguments) in enumerate(expression.operations):
        entry = -1
        if operator in ("input", "const"):
            entry = builder.add(operator, *arguments)
            if operator == "const":
                numbers[index] = float(arguments[0])
        elif operator == "acos":
            angles[index] = (moved[arguments[0]], 1.0, 0.0)
        elif any(argument in angles for argument in arguments):
            angle = _shifted(operator, arguments, angles, numbers)
            if angle is not None:
                angles[index] = angle
            elif operator in ("sin", "cos"):
                entry = _turned(builder, operator, *angles[arguments[0]])
            else:
                raise ValueError(f"an angle of an actuator occurs in sines and cosines alone: got {operator}")
        else:
            entry = builder.add(operator, *(moved[argument] for argument in arguments))
        moved.append(entry)
    if any(index in angles for index in expression.outputs):
        raise ValueError("an angle of an actuator occurs in sines and cosines alone: it is an output")
    return _pruned(builder.operations, tuple(moved[index] for index in expression.outputs))


def _shifted(
    operator: str, arguments: list[int], angles: Mapping[int, tuple[int, float, float]], numbers: Mapping[int, float]
) -> tuple[int, float, float] | None:
    """The angle ±acos(u) + k that an operation makes of another, or None."""
    if operator == "neg":
        u, sign, shift = angles[arguments[0]]
        return u, -sign, -shift
    if operator not in ("add", "sub"):
        return None
    first, second = arguments
    if first in angles and second in numbers:
        u, sign, shift = angles[first]
        return u, sign, shift + (numbers[second] if operator == "add" else -numbers[second])
    if second in angles and first in numbers:
        u, sign, shift = angles[second]
        turn = 1.0 if operator == "add" else -1.0
        return u, turn * sign, numbers[first] + turn * shift
    return None


def _turned(builder: _Builder, operator: str, u: int, sign: float, shift: float) -> int:
    """The sine or cosine of sign · acos(u) + shift."""
    root = builder.add("sqrt", builder.add("sub", builder.const(1.0), builder.add("sq", u)))
    along, across = math.cos(shift), -sign * math.sin(shift)
    if operator == "sin":
        along, across = math.sin(shift), sign * math.cos(shift)
    parts = builder.add("mul", builder.const(along), u), builder.add("mul", builder.const(across), root)
    return builder.add("add", *parts)


def _pruned(operations: list[tuple[Any, ...]], outputs: tuple[int, ...]) -> Expression:
    """Only the operations that an output needs, in order."""
    needed = set(outputs)
    for index in reversed(range(len(operations))):
        operator, *arguments = operations[index]
        if index in needed and operator not in ("input", "const"):
            needed.update(arguments)
    moved = {old: new for new, old in enumerate(sorted(needed))}
    kept = []
    for old in sorted(needed):
        operator, *arguments = operations[old]
        kept.append((operator, *(arguments if operator in ("input", "const") else (moved[a] for a in arguments))))
    used = tuple(operation[1] for operation in kept if operation[0] == "input")
    return Expression(inputs=used, operations=tuple(kept), outputs=tuple(moved[o] for o in outputs))


def _casadi_operators(ca: Any) -> dict[int, Callable[..., int]]:
    return {
        ca.OP_ADD: lambda b, i, j: b.add("add", i, j),
        ca.OP_SUB: lambda b, i, j: b.add("sub", i, j),
        ca.OP_MUL: lambda b, i, j: b.add("mul", i, j),
        ca.OP_DIV: lambda b, i, j: b.add("div", i, j),
        ca.OP_NEG: lambda b, i: b.add("neg", i),
        ca.OP_SQ: lambda b, i: b.add("sq", i),
        ca.OP_SQRT: lambda b, i: b.add("sqrt", i),
        ca.OP_TANH: lambda b, i: b.add("tanh", i),
        ca.OP_SIN: lambda b, i: b.add("sin", i),
        ca.OP_COS: lambda b, i: b.add("cos", i),
        ca.OP_EXP: lambda b, i: b.add("exp", i),
        ca.OP_LOG: lambda b, i: b.add("log", i),
        ca.OP_ASIN: lambda b, i: b.add("asin", i),
        ca.OP_ACOS: lambda b, i: b.add("acos", i),
        ca.OP_ATAN: lambda b, i: b.add("atan", i),
        ca.OP_ATAN2: lambda b, i, j: b.add("atan2", i, j),
        ca.OP_FABS: lambda b, i: b.add("abs", i),
        ca.OP_FMIN: lambda b, i, j: b.add("min", i, j),
        ca.OP_FMAX: lambda b, i, j: b.add("max", i, j),
        ca.OP_TWICE: lambda b, i: b.add("mul", b.const(2.0), i),
        ca.OP_INV: lambda b, i: b.add("div", b.const(1.0), i),
        ca.OP_ASSIGN: lambda b, i: i,
        **{getattr(ca, f"OP_{name.upper()}"): _plain(name) for name in _UNBOUNDED},
        ca.OP_CONSTPOW: _plain("pow"),
    }


def _plain(name: str) -> Callable[..., int]:
    return lambda builder, *arguments: builder.add(name, *arguments)


class _Builder:
    """Collects operations and gives equal ones the same index."""

    def __init__(self) -> None:
        self.operations: list[tuple[Any, ...]] = []
        self._index: dict[tuple[Any, ...], int] = {}

    def add(self, *operation: Any) -> int:
        if operation not in self._index:
            self._index[operation] = len(self.operations)
            self.operations.append(operation)
        return self._index[operation]

    def const(self, value: float) -> int:
        return self.add("const", repr(float(value)))
