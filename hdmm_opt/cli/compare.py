"""`hdmm-opt compare`."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from .inputs import study_of
from .options import ALLOW_CODE, BUDGET, JOBS, QUIET_OPTION, SEED, options_of
from .statuses import PROVED

if TYPE_CHECKING:
    from ..jobs.options import Options


@click.command()
@click.argument("study")
@click.option("-o", "output", type=click.Path(path_type=Path), help="JSON file for gains and figures of all.")
@click.option("--report", type=click.Path(path_type=Path, file_okay=False), help="Folder for an HTML page.")
@SEED
@JOBS
@BUDGET
@ALLOW_CODE
@QUIET_OPTION
def command(
    study: str, output: Path | None, report: Path | None, seed: int | None, jobs: int, budget: str, allow_code: bool
) -> None:
    """Compare the law with its rivals on STUDY: equal tuning budget, same scenarios, same knowledge of the plant."""
    sys.exit(run(study, output, report, options_of(jobs, None, seed, False, budget), allow_code))


def run(name: str, output: Path | None, report: Path | None, options: Options, allow_code: bool) -> int:
    """Tune all, run all, show the table."""
    from ..files.comparison import COMPARISON_NAME, gains_text, write_comparison
    from ..files.report import check_report
    from ..files.seal import to_text
    from ..files.text import check_writable, prepared_folder, write_text
    from ..jobs.challenges import assumed_of, challenges
    from ..jobs.compare import compare, table
    from ..jobs.evaluation import cost_scenarios
    from ..jobs.options import effort_of
    from ..problem import assemble
    from ..simulation import within_assumptions
    from .progress import bar

    study = study_of(name, allow_code)
    if output is not None:
        check_writable(output)
    if report is not None:
        check_report()
        prepared_folder(report, COMPARISON_NAME)
    problem, effort = assemble(study), effort_of(study, options)
    budget = (effort.population, effort.iterations)
    with bar() as progress:
        found = compare(problem, budget, options.seed_of(study), options, progress)
    proved = [s.name for s in challenges(problem, options.seed_of(study)) if within_assumptions(problem, s)]
    table(found, proved, problem.machine.output_unit, click.echo)
    each, told = budget[0] * (budget[1] + 1), found[0].trials
    on = ", ".join(s.name for s in cost_scenarios(problem))
    tuned = f"{each} candidates for each of {len(told)} seeds and each controller, tuned on {on}"
    click.echo(
        f"{tuned}, scored on all runs above; max: the middle seed's largest error after the transient, least and most: "
        "of all seeds; limits: largest share used; travel: total variation of the input; * the least error",
        err=True,
    )
    for c in found:
        click.echo(f"{c.name}, first seed: {gains_text(c)}", err=True)
    click.echo(f"assumed, to be replaced by yours: {assumed_of(problem)}", err=True)
    if output is not None:
        write_text(output, to_text(_data(study, found)))
        click.echo(str(output))
    if report is not None:
        click.echo(str(write_comparison(problem, found, tuned, proved, assumed_of(problem), report)))
    return PROVED


def _data(study: Any, found: Any) -> dict[str, Any]:
    from ..jobs.compare import SCHEMA
    from ..simulation.figures import plain

    rows = [
        {"name": c.name, "trials": [
            {"gains": dict(t.gains), "cost": plain(t.cost), "candidates": t.evaluations, "certified_m": t.certified,
             "scenarios": {key: m.to_data() for key, m in t.figures.items()}}
            for t in c.trials
        ]}
        for c in found
    ]  # fmt: skip
    return {"schema": SCHEMA, "study": study.model_dump(mode="json", exclude_none=True), "controllers": rows}
