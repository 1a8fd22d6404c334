"""What rows track: sums of signals, a balance, or quotients of a load and a constant.

Must fail: a signal without a bounded rate; it is refused where the loop is made.
"""

from __future__ import annotations

from fractions import Fraction
from typing import Any

from .forms import Form

#: Derivatives of the reference that have a bounded rate.
SIGNALS = ("r0", "r1", "r2")


def placed(row: dict[str, Any]) -> dict[str, Fraction]:
    """Coefficients of the signals whose sum is the target of a row that follows no other."""
    target = row["target"]
    if isinstance(target, dict):
        return target
    if target == "balance":
        return {f"@{row['state']}": Fraction(1)}
    return {"r0": Fraction(1)} if target == "reference" else {}


def rate_of(row: dict[str, Any]) -> Form:
    """The rate of the target of a row that tracks nothing but the reference."""
    return {f"r{int(s[1]) + 1}": (v, v) for s, v in placed(row).items()}


def joined(program: dict[str, Any], names: set[str]) -> dict[str, Any]:
    """An operation list with the quotients of two inputs that are named "A/B" as inputs of their own."""
    operations = program["operations"]
    read = {k: operation[1] for k, operation in enumerate(operations) if operation[0] == "input"}
    made = []
    for operation in operations:
        name = "/".join(str(read.get(k, "")) for k in operation[1:]) if operation[0] == "div" else ""
        made.append(["input", name] if name in names else operation)
    return {**program, "operations": made}
