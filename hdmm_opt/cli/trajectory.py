"""`hdmm-opt trajectory`."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from .inputs import any_study_of
from .options import ALLOW_CODE, QUIET_OPTION
from .statuses import PROVED

if TYPE_CHECKING:
    from ..problem import Problem

#: Shortest time between two rows of a reference as CSV, s.
STEP = 0.001


@click.command()
@click.argument("study")
@click.option("-o", "output", type=click.Path(path_type=Path), help="Write it: .json, or .csv of its points.")
@ALLOW_CODE
@QUIET_OPTION
def command(study: str, output: Path | None, allow_code: bool) -> None:
    """Build the reference of STUDY alone, and show the limits that it respects."""
    sys.exit(run(study, output, allow_code))


def run(name: str, output: Path | None, allow_code: bool) -> int:
    """Build references or motions, show them, write them."""
    from ..errors import InvalidInputError
    from ..files.motions import document, table
    from ..files.seal import to_text
    from ..files.text import check_writable, write_text
    from ..problem import assemble
    from ..study import Study

    chosen = any_study_of(name, allow_code)
    if output is not None:
        if output.suffix not in (".json", ".csv"):
            raise InvalidInputError(f"a trajectory is named .json or .csv: got {output}; give -o another name")
        check_writable(output)
    as_csv = output is not None and output.suffix == ".csv"
    if isinstance(chosen, Study):
        problem = assemble(chosen)
        click.echo(
            f"{chosen.study.name}: {len(chosen.reference.waypoints) - 1} moves ({chosen.reference.kind}), "
            f"{problem.duration:.4g} s"
        )
        _members(problem)
        text = _csv(problem) if as_csv else to_text(_references(problem))
    else:
        ways = _motion(chosen)
        text = table(ways) if as_csv else to_text(document(chosen, ways))
    if output is not None:
        write_text(output, text)
        click.echo(str(output))
    return PROVED


def _references(problem: Problem) -> dict[str, Any]:
    from ..files.sections import reference_data

    return {
        "members": [
            {"name": m.name, "reference": reference_data(m.reference, m.plant.reference_units)} for m in problem.members
        ]
    }


def _members(problem: Problem) -> None:
    """Peaks of every member beside what limits them."""
    from ..motions.single_axis import effort_table, largest_loads

    if problem.loads is None:
        for member in problem.members:
            for row in effort_table(problem.study, member.plant, member.reference):
                what = f"{problem.prefix(member)}{row['quantity']}"
                limit = "no limit" if row["limit"] is None else f"limit {row['limit']:g}"
                click.echo(f"  {what:13} {row['peak']:10.4g} {row['unit']:6} {limit}")
            if member.plant.efforts is not None:
                loads = ", ".join(f"{load:g} {member.plant.load_unit}" for load in largest_loads(problem.study))
                click.echo(f"  efforts at the nominal machine under the largest load, {loads}")
        return
    foreseen = problem.loads.feedforward(problem.slices)
    for member, (load, _), own in zip(problem.members, foreseen, problem.machine.own, strict=True):
        unit, (position, speed, acceleration, _) = member.plant.state_units[0], member.reference.bounds()
        click.echo(
            f"  {member.name:10} {position[0]:.4g} to {position[1]:.4g} {unit}, speed {max(map(abs, speed)):.3g}, "
            f"acceleration {max(map(abs, acceleration)):.3g}"
        )
        click.echo(
            f"  {'':10} load {load.low:.4g} to {load.high:.4g} {member.plant.load_unit} beside an inertia of {own:g}"
        )


def _csv(problem: Problem) -> str:
    """References of all members at their control instants; the header carries the units."""
    import numpy as np

    from ..files.text import csv_text

    t = np.arange(0.0, problem.duration, max(problem.period, STEP))
    columns: dict[str, Any] = {"time [s]": t}
    for member in problem.members:
        prefix = f"{member.name} " if len(problem.members) > 1 else ""
        for what, unit, row in zip(
            ("position", "speed", "acceleration", "jerk"),
            member.plant.reference_units,
            member.reference(t),
            strict=True,
        ):
            columns[f"{prefix}{what} [{unit}]"] = row
    return csv_text({name: np.asarray(values).tolist() for name, values in columns.items()})


def _motion(chosen: Any) -> Any:
    """The motions of a study without a controller."""
    from trajectories import LimitViolatedError

    from ..errors import InvalidInputError
    from ..motions.from_study import motions_of
    from .progress import bar

    with bar() as progress:
        progress.stage(chosen.study.name)
        try:
            ways = motions_of(chosen, progress.update)
        except LimitViolatedError as error:
            raise InvalidInputError(f"{chosen.study.name}: {error}") from None
    columns = [("energy", "energy [J]"), ("loss", "lost [J]"), ("effort", "effort [s]")]
    columns = [(name, head) for name, head in columns if name in ways[0].totals]
    heads = ("time [s]", *(head for _, head in columns), "efficiency")
    click.echo(f"{'motion':20}" + "".join(f"{head:>12}" for head in heads))
    for way in ways:
        share = "-" if way.efficiency is None else f"{way.efficiency:.3f}"
        costs = "".join(f"{way.totals[name]:12.5g}" for name, _ in columns)
        click.echo(f"{way.name:20}{way.duration:12.4g}{costs}{share:>12}")
    click.echo("every motion is inside its limits for all t", err=True)
    if chosen.reference.kind == "toppra":
        click.echo("not limited, because the jerk is free: jerks, and quantities that depend on them", err=True)
    if ways[0].job.mover.assumed:
        click.echo(f"assumed, to be replaced by yours: {', '.join(ways[0].job.mover.assumed)}", err=True)
    return ways
