"""Designs: one, many, and beside others."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Literal

from ..study import Study
from .records import Designed, Table
from .studies import study_of
from .threads import alone

if TYPE_CHECKING:
    from ..jobs.options import Options

Budget = Literal["quick", "full"]


def _options(seed: int | None, jobs: int, budget: str) -> Options:
    from ..errors import InvalidInputError
    from ..jobs.options import Options

    if budget not in ("quick", "full") or not isinstance(jobs, int) or jobs < 1:
        raise InvalidInputError(
            f'budget is "quick" or "full", jobs a whole number of at least 1: got {budget!r}, {jobs!r}; correct them'
        )
    return Options(seed=seed, jobs=jobs, full=budget == "full")


@alone
def design(
    study: Study | str | Path, *, jobs: int = 1, seed: int | None = None, budget: Budget = "quick", quiet: bool = False
) -> Designed:
    """The main job: reference, gains, proof, validation. Nothing is written; see `Designed.save`.

    Args:
        study: A study, or its name.
        jobs: Processes for the search, threads for the runs. More than one starts processes: in a script, call it
            under `if __name__ == "__main__"`.
        seed: Seed of the search; that of the study where None.
        budget: "quick" as the study says, "full" 620 candidates judged by refined proofs (5,000 plain ones
            where those are not), 1,000 random runs and 10,000 attacks.
        quiet: Whether to show no progress.

    Returns:
        The design; proved, or with what failed.

    Raises:
        InvalidInputError: the study cannot be made concrete.
        DefectError: a simulation left its certified envelope.
    """
    from ..files.rejected import rejected_document
    from ..jobs.pipeline import design as run
    from ..jobs.showing import bar

    with bar(quiet=quiet) as progress:
        found = run(study_of(study), _options(seed, jobs, budget), progress)
    if found.document is not None and found.report is not None:
        return Designed(document=found.document, message=found.report.message, notes=found.notes)
    failures = tuple(
        (f"{v.member} {v.name}".strip(), f"{v.margin:.4g} {v.unit}", v.remedy or v.statement) for v in found.verdicts
    )
    failures += tuple(("requirement", "missed", line) for line in found.missed)
    return Designed(document=rejected_document(found), message="not proved", failures=failures)


@alone
def compare(
    study: Study | str | Path, *, jobs: int = 1, seed: int | None = None, budget: Budget = "quick", quiet: bool = False
) -> Table:
    """The law beside its rivals from the literature: equal budget, same scenarios; arguments as for `design`.

    Raises:
        InvalidInputError: the study cannot be made concrete, or has no gains to search.
    """
    from ..jobs.challenges import challenges
    from ..jobs.compare import compare as run
    from ..jobs.options import effort_of
    from ..jobs.showing import bar
    from ..problem import assemble
    from ..simulation import within_assumptions

    chosen, options = study_of(study), _options(seed, jobs, budget)
    problem, effort = assemble(chosen), effort_of(chosen, options)
    with bar(quiet=quiet) as progress:
        found = run(problem, (effort.population, effort.iterations), options.seed_of(chosen), options, progress)
    inside = [s.name for s in challenges(problem, options.seed_of(chosen)) if within_assumptions(problem, s)]
    rows = tuple(
        (
            c.name, 1e3 * max(c.middle(name).maximum_error_m for name in inside),
            1e3 * max(c.middle(name).rms_error_m for name in inside),
            None if c.certified is None else 1e3 * c.certified, sum(trial.evaluations for trial in c.trials),
        )
        for c in found
    )  # fmt: skip
    unit = f"m{problem.machine.output_unit}"
    heads = ("controller", f"largest error [{unit}]", f"RMS error [{unit}]", f"certified [{unit}]", "candidates")
    title = f"{chosen.study.name}: all scenarios inside the assumptions"
    return Table(title=title, heads=heads, rows=rows, axes=(heads[2], heads[1]), data=found)


@alone
def sweep(
    study: Study | str | Path, vary: Mapping[str, Sequence[float]], *, jobs: int = 1, seed: int | None = None,
    budget: Budget = "quick", quiet: bool = False,
) -> Table:  # fmt: skip
    """A design at every point of a grid of the study's numbers.

    Args:
        study: A study, or its name.
        vary: Values of each number by its place in the study, such as "controller.rate_hz".
        jobs: Processes for the designs.
        seed: As for `design`.
        budget: As for `design`.
        quiet: Whether to show no progress.

    Raises:
        InvalidInputError: a place that the study does not have, or a value that it refuses.
    """
    from ..jobs.showing import bar
    from ..jobs.sweep import Axis
    from ..jobs.sweep import sweep as run

    chosen = study_of(study)
    axes = [Axis(key=key, values=tuple(map(float, values))) for key, values in vary.items()]
    with bar(quiet=quiet) as progress:
        rows, _ = run(chosen, axes, _options(seed, jobs, budget), progress)
    heads = (*vary, "verdict", "certified error [m]", "simulated error [m]")
    values = tuple(
        (*row["values"].values(), row["verdict"], row["certified_error_m"], row["simulated_error_m"]) for row in rows
    )
    return Table(title=f"{chosen.study.name}: designs", heads=heads, rows=values, axes=(heads[0], heads[-2]), data=rows)


@alone
def tradeoff(
    study: Study | str | Path, *, population: int = 32, iterations: int = 25, jobs: int = 1, seed: int | None = None,
    quiet: bool = False,
) -> Table:  # fmt: skip
    """The Pareto set of a study's gains: simulated error, certified error, share of the limits.

    Args:
        study: A study, or its name.
        population: Candidates.
        iterations: Evaluations of each after the first.
        jobs: Processes for the candidates.
        seed: Seed of the search; that of the study where None.
        quiet: Whether to show no progress.

    Raises:
        InvalidInputError: the study cannot be made concrete, or has no gains to search.
    """
    from ..jobs.evaluation import OBJECTIVES
    from ..jobs.options import Options
    from ..jobs.showing import bar
    from ..jobs.tradeoff import rows
    from ..jobs.tradeoff import tradeoff as run

    chosen = study_of(study)
    with bar(quiet=quiet) as progress:
        found, _ = run(chosen, Options(seed=seed, jobs=jobs), progress, (population, iterations))
    table = rows(found)
    heads = (*OBJECTIVES, *(table[0]["gains"] if table else ()))
    values = tuple((*row["objectives"].values(), *row["gains"].values()) for row in table)
    title = f"{chosen.study.name}: shares of what is required and allowed; none is beaten"
    return Table(title=title, heads=heads, rows=values, axes=(OBJECTIVES[1], OBJECTIVES[2]), data=table)
