"""Feasibility first: how two candidates are compared."""

from __future__ import annotations

import math
from dataclasses import dataclass


@dataclass(frozen=True, kw_only=True)
class Outcome:
    """What is known of a candidate.

    Attributes:
        violation: How far it is from being proved and inside its limits; 0 for a feasible candidate.
        cost: Closed-loop cost of a feasible candidate; infinite for an infeasible one, which is never simulated.
        objectives: The parts that a Pareto set trades off; empty for an infeasible candidate.
        runs: Closed-loop runs that were spent on it.

    Raises:
        ValueError: a finite cost beside a violation.
    """

    violation: float
    cost: float
    objectives: tuple[float, ...] = ()
    runs: int = 0

    def __post_init__(self) -> None:
        if self.violation > 0 and (math.isfinite(self.cost) or self.runs):
            raise ValueError("an infeasible candidate has no cost: it is not simulated")

    @property
    def feasible(self) -> bool:
        """Proved and inside all limits."""
        return self.violation <= 0

    def rank(self) -> tuple[float, float]:
        """Sorting key: feasible before infeasible, then cost, then violation (Deb 2000)."""
        return (max(self.violation, 0.0), self.cost)
