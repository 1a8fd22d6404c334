"""Projection of gains to short decimals: fewer digits where neither proof nor cost suffers."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import TypeVar

from .comparison import Outcome

T = TypeVar("T")

#: The cost may rise by this share for shorter gains.
PRICE = 0.005


def rounded(value: float, digits: int, low: float, high: float) -> float:
    """The nearest decimal of so many significant digits inside a range; an end of the range where none is."""
    return min(max(float(f"{value:.{digits}g}"), low), high)


def shortest(
    choices: Sequence[T], evaluate: Callable[[Sequence[T]], list[Outcome]], now: Outcome
) -> tuple[T, Outcome] | None:
    """The first choice that is feasible and costs at most `PRICE` more than now.

    Args:
        choices: From the shortest on.
        evaluate: Outcomes of a list of choices: each is proved anew.
        now: Outcome of the gains as they are.

    Returns:
        The choice and its outcome, or None.
    """
    for choice, outcome in zip(choices, evaluate(choices), strict=True):
        if outcome.feasible and outcome.cost <= (1 + PRICE) * now.cost:
            return choice, outcome
    return None
