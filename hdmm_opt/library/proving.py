"""Gain files: checked, simulated, attacked, reported."""

from __future__ import annotations

from pathlib import Path

from .records import Checked, Designed, Simulated, Table, document_of, page_of
from .threads import alone

Given = Designed | str | Path


def check(given: Given) -> Checked:
    """Re-prove a gain file or a design from its data alone, in exact arithmetic.

    Returns:
        The verdict; a file that cannot be read has the status 2 and says why.
    """
    from stability import checker

    from ..files.seal import to_text

    if isinstance(given, Designed):
        return Checked(verdict=checker.check_text(to_text(dict(given.document)), given.name))
    return Checked(verdict=checker.check_file(Path(given)))


@alone
def simulate(given: Given, scenario: str | None = None) -> Simulated:
    """Run the closed loop with the gains of a file or of a design.

    Args:
        given: A design, or a gain file, or what a refusal left.
        scenario: One scenario by name; all where None.

    Raises:
        InvalidInputError: the file cannot be read, or has no such scenario.
    """
    from ..errors import InvalidInputError
    from ..files.read import certified_of, rejected
    from ..files.restore import offered, restored
    from ..names import nearest
    from ..simulation import Run, within_assumptions
    from ..simulation.requirements import missed

    document = document_of(given)
    problem, gains = restored(document)
    known = offered(document, problem)
    if scenario is not None and scenario not in known:
        raise InvalidInputError(f'no scenario "{scenario}"; {nearest(scenario, known)}')
    figures, traces, lines = {}, {}, []
    for name in known if scenario is None else [scenario]:
        loop, run = known[name]
        (figures[name],) = loop.figures([Run(gains=gains, scenario=run)])
        traces[name] = loop.trace(gains, run)
        lines += missed(problem, name, figures[name]) if within_assumptions(problem, run) else []
    bound = None if rejected(document) else certified_of(document)
    return Simulated(
        figures=figures, missed=tuple(lines), traces=traces, bound_m=bound, unit=problem.machine.output_unit
    )


@alone
def falsify(given: Given, *, budget: int = 300, seed: int = 1, jobs: int = 1, quiet: bool = False) -> Table:
    """Search the worst load, parameters and start inside the assumptions of a proved file; the file stays as it is.

    Args:
        given: A proved design or gain file.
        budget: Number of runs.
        seed: Seed of the search.
        jobs: Threads.
        quiet: Whether to show no progress.

    Raises:
        InvalidInputError: the file is not proved.
        DefectError: a run left the certified envelope.
    """
    from ..errors import InvalidInputError
    from ..jobs.attack import attacked
    from ..jobs.showing import bar

    verdict = check(given)
    if not verdict.proved:
        raise InvalidInputError(
            f"{verdict.verdict.file}: {verdict.verdict.message}; only a proved file can be attacked"
        )
    if not isinstance(budget, int) or budget < 1 or not isinstance(jobs, int) or jobs < 1:
        raise InvalidInputError(
            f"budget and jobs are whole numbers of at least 1: got {budget!r}, {jobs!r}; correct them"
        )
    document = document_of(given)
    with bar(quiet=quiet) as progress:
        problem, found = attacked(document, budget, seed, progress, jobs=jobs)
    unit = f"m{problem.machine.output_unit}"
    heads = ("runs", f"worst error [{unit}]", f"certified [{unit}]", "share of the limits")
    from ..files.read import certified_of

    row = (found.runs, 1e3 * found.figures.maximum_error_m, 1e3 * certified_of(document), found.largest_use)
    return Table(title="none outside the certified envelope (that proves nothing more)", heads=heads, rows=(row,),
                 axes=(heads[0], heads[1]), data=found)  # fmt: skip


@alone
def report(given: Given, folder: str | Path = "report") -> Path:
    """Write the HTML page of a design, a gain file, or what a refusal left.

    Returns:
        The page.

    Raises:
        InvalidInputError: the report libraries are not installed, or the folder cannot be written.
    """
    return page_of(document_of(given), Path(folder))
