"""Random search, the baseline that every method has to beat."""

from __future__ import annotations

from dataclasses import replace

from ..population import Evaluate, Population, greedy


def random_search(evaluate: Evaluate, state: Population) -> Population:
    """One iteration: as many uniform draws as there are candidates, kept where they are better."""
    random = state.generator()
    trial = random.uniform(size=state.points.shape)
    return replace(greedy(evaluate, state, trial, random), iteration=state.iteration + 1)
