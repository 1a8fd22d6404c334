"""A search with a budget: a method repeated from a first population, resumable after each iteration."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from .budget import Budget
from .comparison import Outcome
from .methods.jaya import jaya
from .methods.random_search import random_search
from .methods.tlbo import tlbo
from .population import Evaluate, Population, start

Array = NDArray[np.float64]

#: Methods by name, and how often one iteration evaluates each candidate.
METHODS: dict[str, tuple[Callable[[Evaluate, Population], Population], int]] = {
    "jaya": (jaya, 1),
    "tlbo": (tlbo, 2),
    "random": (random_search, 1),
}


@dataclass(frozen=True, kw_only=True)
class Best:
    """The best candidate of a search; it is proved and inside all limits, or it is not made.

    Attributes:
        point: The candidate. Shape (d,).
        outcome: Its outcome.

    Raises:
        ValueError: the outcome is infeasible.
    """

    point: Array
    outcome: Outcome

    def __post_init__(self) -> None:
        if not self.outcome.feasible:
            raise ValueError(f"the best candidate must be feasible: got a violation of {self.outcome.violation:g}")


def best_of(state: Population) -> Best | None:
    """The best candidate, or None where none is feasible."""
    found = state.outcomes[state.best]
    return Best(point=state.points[state.best], outcome=found) if found.feasible else None


def search(
    method: str, evaluate: Evaluate, first: Array, population: int, seed: int, budget: Budget, *,
    restored: Population | None = None, after: Callable[[Population], None] = lambda state: None,
) -> Population:  # fmt: skip
    """Repeat a method until the budget is used.

    Args:
        method: A key of `METHODS`.
        evaluate: Outcomes of a list of candidates, pure.
        first: The candidate to begin with. Shape (d,).
        population: Number of candidates.
        seed: Seed of the random generator.
        budget: When to stop; an iteration that does not fit is not begun.
        restored: A state to go on from, in the place of a first population.
        after: Called with the state before the first and after each iteration.

    Returns:
        The last state. Not guaranteed: that its best is feasible, or the best there is; see `best_of`.

    Raises:
        ValueError: unknown method.
    """
    if method not in METHODS:
        raise ValueError(f"methods are {', '.join(METHODS)}: got {method}")
    step, share = METHODS[method]
    begun = time.monotonic()
    state = start(evaluate, first, population, seed) if restored is None else restored
    after(state)
    while state.evaluations + share * population <= budget.evaluations and time.monotonic() - begun < budget.seconds:
        state = step(evaluate, state)
        after(state)
    return state
