"""How a job runs, and where it reports to."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from ..study import Study


@dataclass(frozen=True, kw_only=True)
class Progress:
    """Where a job reports to.

    Attributes:
        stage: Called with the name of a stage.
        update: Called with a share of the stage done, and a text such as the best so far.
    """

    stage: Callable[[str], None] = lambda name: None
    update: Callable[[float, str], None] = lambda share, text: None


@dataclass(frozen=True, kw_only=True)
class Options:
    """How to run.

    Attributes:
        seed: Seed of the search; that of the study where None.
        jobs: Processes for candidates, threads for runs.
        full: The large budget.
        state: File that keeps the state of the job; None keeps none.
        resume: Go on from that file.
        cluster: Address of a Dask scheduler for the candidates, or "local".
    """

    seed: int | None = None
    jobs: int = 1
    full: bool = False
    state: Path | None = None
    resume: bool = False
    cluster: str | None = None

    def seed_of(self, study: Study) -> int:
        """The seed of a job."""
        return study.tuning.seed if self.seed is None else self.seed


@dataclass(frozen=True, kw_only=True)
class Effort:
    """How much a design may cost.

    Attributes:
        population: Candidates of the search.
        iterations: Evaluations of each after the first.
        monte_carlo: Runs with random scenarios.
        falsify: Runs that try to break the proof.
    """

    population: int
    iterations: int
    monte_carlo: int
    falsify: int


#: `--budget full`.
FULL = Effort(population=50, iterations=100, monte_carlo=1000, falsify=10_000)
#: Population and iterations of the same where each candidate is judged by refined proofs.
FINE = (20, 30)


def effort_of(study: Study, options: Options) -> Effort:
    """The budget of a design."""
    if options.full:
        return FULL
    tuning, validation = study.tuning, study.validation
    return Effort(
        population=tuning.population, iterations=tuning.iterations, monte_carlo=validation.monte_carlo,
        falsify=validation.falsify,
    )  # fmt: skip
