"""`hdmm-opt simulate`."""

from __future__ import annotations

import json
import sys
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from .statuses import NOT_PROVED, PROVED

if TYPE_CHECKING:
    from ..problem import Problem
    from ..simulation import Trace


@click.command()
@click.argument("file", type=click.Path(path_type=Path))
@click.option("--scenario", help="One scenario: a name of the study, worst-case, or witness (of a refusal).")
@click.option("--csv", "csv_path", type=click.Path(path_type=Path), help="Write the signals of one scenario as CSV.")
@click.option("--json", "as_json", is_flag=True, help="Print the figures as JSON.")
def command(file: Path, scenario: str | None, csv_path: Path | None, as_json: bool) -> None:
    """Simulate the closed loop with the gains of FILE (a gain file, or what a refusal left behind)."""
    sys.exit(run(file, scenario, csv_path, as_json))


def run(path: Path, name: str | None, csv_path: Path | None, as_json: bool) -> int:
    """Run scenarios, show their figures, and say which requirements they miss."""
    from ..errors import InvalidInputError
    from ..files.read import read
    from ..files.restore import offered, restored
    from ..files.text import check_writable, write_text
    from ..names import nearest
    from ..simulation import Run, within_assumptions
    from ..simulation.requirements import missed

    document = read(path)
    problem, gains = restored(document)
    known = offered(document, problem)
    if name is not None and name not in known:
        raise InvalidInputError(f'{path}: no scenario "{name}"; {nearest(name, known)}')
    chosen = [name] if name is not None else list(known)
    if csv_path is not None:
        if len(chosen) > 1:
            raise InvalidInputError(f"--csv writes one scenario; choose one with --scenario: {', '.join(known)}")
        check_writable(csv_path)
    results = {}
    for key in chosen:
        loop, scenario = known[key]
        (results[key],) = loop.figures([Run(gains=gains, scenario=scenario)])
        if csv_path is not None:
            write_text(csv_path, to_csv(problem, loop.trace(gains, scenario)))
    if as_json:
        click.echo(json.dumps({key: figures.to_data() for key, figures in results.items()}, indent=1))
    else:
        for key, figures in results.items():
            click.echo(key)
            _show(figures.to_data())
    lines = []
    for key, figures in results.items():
        if not within_assumptions(problem, known[key][1], figures):
            what = "has a fault" if known[key][1].faults else "is"
            click.echo(f"{key} {what} outside the assumptions of the proof: no requirement applies", err=True)
        else:
            lines += missed(problem, key, figures)
    for line in lines:
        click.echo(f"requirement missed: {line}", err=True)
    return NOT_PROVED if lines else PROVED


def _show(data: Mapping[str, Any], indent: str = "  ") -> None:
    """Figures as text, one a line."""
    for key, value in data.items():
        if isinstance(value, Mapping):
            click.echo(f"{indent}{key}")
            _show(value, indent + "  ")
        elif isinstance(value, list):
            if value:
                click.echo(f"{indent}{key:18} " + " ".join(f"{v:.6g}" for v in value))
        else:
            click.echo(f"{indent}{key:18} " + ("none" if value is None else f"{value:.6g}"))


def to_csv(problem: Problem, trace: Trace) -> str:
    """Signals as CSV, one row a control instant; the header carries the units."""
    from ..files.text import csv_text

    several = len(problem.members) > 1
    columns: dict[str, Any] = {"time [s]": trace.t}
    for disturbance in problem.machine.disturbances:
        columns[f"{disturbance.name} [{disturbance.unit}]"] = trace.disturbances[disturbance.name]
    columns |= trace.body
    columns[f"error [{problem.machine.output_unit}]"] = trace.error
    for k, letter in enumerate(problem.machine.coordinates if several and not trace.free else ()):
        columns |= {f"output {letter} [m]": trace.place[k], f"output reference {letter} [m]": trace.wanted[k]}
    for member in problem.members:
        own, plant, prefix = trace.members[member.name], member.plant, f"{member.name} " if several else ""
        orders = ("position", "speed", "acceleration", "jerk")
        for name, unit, row in zip(orders, plant.reference_units, own.r, strict=True):
            columns[f"{prefix}reference {name} [{unit}]"] = row
        pairs = zip(plant.states, plant.state_units, own.x, strict=True)
        columns |= {f"{prefix}{s} [{u}]": row for s, u, row in pairs}
        columns |= {f"{prefix}{s} [{plant.input_unit}]": row for s, row in zip(plant.inputs, own.u, strict=True)}
        columns |= {f"{prefix}theta_{k + 1}": row for k, row in enumerate(own.z)}
    return csv_text({name: values.tolist() for name, values in columns.items()})
