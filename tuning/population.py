"""A population of candidates: what a search knows after some iterations, and all that it needs to go on."""

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
class Population:
    """Candidates and their outcomes.

    Attributes:
        iteration: Iterations done.
        points: Candidates in the unit cube. Shape (p, d).
        outcomes: One for each candidate.
        random: State of the random generator.
        evaluations: Candidates evaluated so far, infeasible ones included.
        runs: Closed-loop runs so far.
    """

    iteration: int
    points: Array
    outcomes: tuple[Outcome, ...]
    random: dict[str, Any]
    evaluations: int
    runs: int

    @property
    def order(self) -> list[int]:
        """Indices from the best candidate to the worst."""
        return sorted(range(len(self.outcomes)), key=lambda i: self.outcomes[i].rank())

    @property
    def best(self) -> int:
        """Index of the best candidate."""
        return self.order[0]

    def generator(self) -> np.random.Generator:
        """A random generator that goes on where the last one stopped."""
        random = np.random.default_rng()
        random.bit_generator.state = self.random
        return random


def start(evaluate: Evaluate, first: Array, population: int, seed: int) -> Population:
    """The first population: a given candidate, draws around it, and uniform draws.

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
    points = np.clip(np.vstack([first[None, :], around, spread]), 0.0, 1.0)
    outcomes = tuple(evaluate(list(points)))
    return Population(
        iteration=0, points=points, outcomes=outcomes, random=dict(random.bit_generator.state),
        evaluations=population, runs=sum(o.runs for o in outcomes),
    )  # fmt: skip


def greedy(evaluate: Evaluate, state: Population, trial: Array, random: np.random.Generator) -> Population:
    """Evaluate one trial for each candidate and keep the better of the two; counts the evaluations.

    Args:
        evaluate: As in `start`.
        state: The candidates.
        trial: Their rivals, clipped to the unit cube here. Shape (p, d).
        random: The generator, whose state is kept.
    """
    trial = np.clip(trial, 0.0, 1.0)
    rivals = evaluate(list(trial))
    better = [new.rank() < old.rank() for new, old in zip(rivals, state.outcomes, strict=True)]
    return Population(
        iteration=state.iteration,
        points=np.where(np.array(better)[:, None], trial, state.points),
        outcomes=tuple(n if b else o for n, o, b in zip(rivals, state.outcomes, better, strict=True)),
        random=dict(random.bit_generator.state),
        evaluations=state.evaluations + len(trial),
        runs=state.runs + sum(o.runs for o in rivals),
    )
