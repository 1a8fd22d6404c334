"""JAYA as published: no algorithm parameters, greedy acceptance."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .comparison import Outcome

Array = NDArray[np.float64]
Evaluate = Callable[[Sequence[Array]], list[Outcome]]


@dataclass(frozen=True, kw_only=True)
class SearchState:
    """A population after some iterations; all that is needed to go on.

    Attributes:
        iteration: Iterations done.
        population: Candidates in the unit cube. Shape (p, d).
        outcomes: One for each candidate.
        random: State of the random generator.
        evaluations: Candidates evaluated so far.
    """

    iteration: int
    population: Array
    outcomes: tuple[Outcome, ...]
    random: dict[str, Any]
    evaluations: int

    @property
    def best(self) -> int:
        """Index of the best candidate."""
        return min(range(len(self.outcomes)), key=lambda i: self.outcomes[i].rank())


def start(evaluate: Evaluate, first: Array, population: int, seed: int) -> SearchState:
    """The first population: a given candidate and uniform draws.

    Args:
        evaluate: Outcomes of a list of candidates, pure.
        first: The candidate to begin with. Shape (d,).
        population: Number of candidates.
        seed: Seed of the random generator.

    Returns:
        The state before the first iteration.
    """
    random = np.random.default_rng(seed)
    around = first + random.uniform(-0.25, 0.25, (population // 2, first.size))
    spread = random.uniform(0.0, 1.0, (population - 1 - len(around), first.size))
    candidates = np.clip(np.vstack([first[None, :], around, spread]), 0.0, 1.0)
    outcomes = tuple(evaluate(list(candidates)))
    return SearchState(
        iteration=0,
        population=candidates,
        outcomes=outcomes,
        random=dict(random.bit_generator.state),
        evaluations=population,
    )


def step(evaluate: Evaluate, state: SearchState) -> SearchState:
    """One iteration: ``x + r1 (best - |x|) - r2 (worst - |x|)``, clipped to the cube, kept only where it is better.

    References:
        R. Venkata Rao (2016), International Journal of Industrial Engineering Computations 7, 19-34, eq. 1.
    """
    random = np.random.default_rng()
    random.bit_generator.state = state.random
    ranks = [outcome.rank() for outcome in state.outcomes]
    order = sorted(range(len(ranks)), key=ranks.__getitem__)
    best, worst, x = state.population[order[0]], state.population[order[-1]], state.population
    r1, r2 = random.uniform(size=x.shape), random.uniform(size=x.shape)
    trial = np.clip(x + r1 * (best - np.abs(x)) - r2 * (worst - np.abs(x)), 0.0, 1.0)
    outcomes = evaluate(list(trial))
    better = [new.rank() < old.rank() for new, old in zip(outcomes, state.outcomes, strict=True)]
    return SearchState(
        iteration=state.iteration + 1,
        population=np.where(np.array(better)[:, None], trial, x),
        outcomes=tuple(n if b else o for n, o, b in zip(outcomes, state.outcomes, better, strict=True)),
        random=dict(random.bit_generator.state),
        evaluations=state.evaluations + len(trial),
    )
