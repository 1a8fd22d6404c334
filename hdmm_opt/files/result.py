"""What a design, a validation and an attack end with."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from stability import checker

from ..problem import GainSet, Problem
from ..problem.verdict import Verdict
from ..simulation import Figures, Scenario


@dataclass(frozen=True, kw_only=True)
class Validation:
    """What the simulations of some gains showed.

    Attributes:
        runs: Scenario and figures of every scenario of the study.
        worst: The corner of the assumptions with the largest error, and its figures; None where not asked.
        monte_carlo: Numbers of runs and of those that met every requirement; None where not asked.
        inside: Figures of all runs inside the assumptions.
        integration_error: Estimated error of the integration on the first scenario, m.
        missed: Requirements that one of them missed, as text.
    """

    runs: tuple[tuple[Scenario, Figures], ...]
    worst: tuple[Scenario, Figures] | None
    monte_carlo: dict[str, int] | None
    inside: tuple[Figures, ...]
    integration_error: float
    missed: tuple[str, ...]

    @property
    def largest_error(self) -> float:
        """Largest error of the output at any time of a run inside the assumptions, m."""
        return max((m.largest_error_m for m in self.inside), default=0.0)

    @property
    def largest_late_error(self) -> float:
        """The same after the transient, m."""
        return max((m.maximum_error_m for m in self.inside), default=0.0)


@dataclass(frozen=True, kw_only=True)
class Witness:
    """The worst run that an attack found.

    Attributes:
        scenario: Replays the run.
        figures: Its figures.
        largest_error: Largest error of the output at any time of any run, m.
        largest_errors: Largest error of each member at any time of any run, in its unit.
        largest_use: Largest share of a limit that any run used; 1 where an input saturated.
        runs: Number of simulated runs.
    """

    scenario: Scenario
    figures: Figures
    largest_error: float
    largest_errors: Mapping[str, float]
    largest_use: float
    runs: int


@dataclass(frozen=True, kw_only=True)
class Design:
    """A finished run of the pipeline.

    Attributes:
        document: The gain file; None where the design was refused.
        report: The checker's report on it; None where no certificate was found.
        verdicts: What failed, the cause first; empty for a proved design that meets its requirements.
        missed: Requirements that a simulation missed.
        gains: The gains.
        problem: What was worked on.
        shown: What the simulations showed; None where the gains are not proved and nothing was simulated.
        notes: Which certificate was taken, and the longest control period at which the gains are proved.
        parts: What the certified error is made of, and what the design would be without each part of its law.
    """

    document: dict[str, Any] | None
    report: checker.Report | None
    verdicts: tuple[Verdict, ...]
    missed: tuple[str, ...]
    gains: GainSet
    problem: Problem
    shown: Validation | None = None
    notes: tuple[str, ...] = ()
    parts: tuple[str, ...] = ()
