"""Whether a plant and a coupling feel what the study states.

Two floats that differ are a witness that they do; nothing is proved of how much. Obligation: plant. Must fail: a
plant that multiplies its load by 0, a parameter without effect, backlash without one in the mirror image of the set
too, a machine that is the same for every payload.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from fractions import Fraction
from typing import Any

from .arithmetic import WORK, Interval
from .claim import Claim
from .forms import walk
from .golden import float_apply
from .limits import NotProvedError

#: Shares of the certified size of every state and input at which a plant is looked at.
SHARES = (-1.0, -0.5, -0.1, -0.01, -0.001, 0.0, 0.001, 0.01, 0.1, 0.5, 1.0)


def effects_of(claim: Claim, ranges: dict[str, Interval]) -> dict[str, Fraction]:
    """The effect on a plant, relative to its row, of going through each stated range inside the certified set.

    A number without a range is moved by a percent; one that is zero is left out.

    Args:
        claim: The statement.
        ranges: Range of every state and input over the certified set.
    """
    stated = {**claim.parameters, **claim.disturbances}
    for name, (value, _) in claim.feedforward.items():
        stated[name] = value[0] + stated[name][0], value[1] + stated[name][1]
    middle = {name: float((low + high) / 2) for name, (low, high) in stated.items()}
    points = [{name: _clipped(low, high, share) for name, (low, high) in ranges.items()} for share in SHARES]
    rates = [_rates(claim, {**middle, **point}) for point in points]
    size = [max(max(abs(r[i]) for r in rates), 1e-300) for i in range(len(claim.rows))]
    found: dict[str, Fraction] = {}
    for name, (low, high) in stated.items():
        ends = _ends(low, high)
        if ends is None:
            continue
        seen = 0.0
        for point in points:
            one, other = (_rates(claim, {**middle, **point, name: end}) for end in ends)
            seen = max(seen, *(abs(a - b) / s for a, b, s in zip(one, other, size, strict=True)))
        found[name] = Fraction(seen)
    return found


def mirrored(ranges: dict[str, Interval]) -> dict[str, Interval]:
    """Where every state has its other sign: a backlash is felt there whose contact never opens in the certified set."""
    return {name: (-high, -low) for name, (low, high) in ranges.items()}


def _clipped(low: Fraction, high: Fraction, share: float) -> float:
    """A share of the largest size of a range, where it lies inside it; else the end that is nearer."""
    wanted = share * max(abs(float(low)), abs(float(high)))
    return min(max(wanted, float(low)), float(high))


def _ends(low: Fraction, high: Fraction) -> tuple[float, float] | None:
    if low < high:
        return float(low), float(high)
    return (float(low), float(low) * 1.01) if low else None


def _rates(claim: Claim, values: dict[str, float]) -> list[float]:
    n, entries = len(claim.rows), run(claim.plant, values.__getitem__)
    return [entries[n + i] / entries[i] for i in range(n)]


def run(program: dict[str, Any], read: Callable[[str], float]) -> list[float]:
    """Outputs of an operation list in floats."""
    WORK.one(1 + len(program["operations"]) // 16)
    try:
        entries = walk(program, read, float, float_apply)
    except (ArithmeticError, ValueError):
        raise NotProvedError("the model has no value at its operating points") from None
    return [entries[i] for i in program["outputs"]]


def felt(
    program: dict[str, Any], middle: dict[str, float], ranges: Mapping[str, Iterable[Any]]
) -> dict[str, list[float]]:
    """How much each output of an operation list changes over a range of each of its inputs, others at their middle."""
    found = {}
    for name, ends in ranges.items():
        one, other = (run(program, {**middle, name: float(end)}.__getitem__) for end in ends)
        found[name] = [abs(a - b) for a, b in zip(one, other, strict=True)]
    return found
