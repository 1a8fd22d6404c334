"""A population as JSON data, so that a search goes on from it."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from tuning import Outcome, Population

from ..files.state import State


def to_data(state: Population) -> dict[str, Any]:
    """A population as JSON data."""
    return {
        "iteration": state.iteration,
        "points": state.points.tolist(),
        "outcomes": [
            [o.violation, o.cost if math.isfinite(o.cost) else None, list(o.objectives), o.runs] for o in state.outcomes
        ],
        "random": state.random,
        "evaluations": state.evaluations,
        "runs": state.runs,
    }


def kept_population(state: State) -> Population | None:
    """The population that a state holds, or None."""
    data = state.get("search")
    if data is None:
        return None
    return Population(
        iteration=data["iteration"],
        points=np.array(data["points"]),
        outcomes=tuple(
            Outcome(violation=v, cost=math.inf if c is None else c, objectives=tuple(o), runs=r)
            for v, c, o, r in data["outcomes"]
        ),
        random=data["random"],
        evaluations=data["evaluations"],
        runs=data["runs"],
    )
