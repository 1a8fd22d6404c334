"""What the verbs do for machines of several joints."""

from __future__ import annotations

import csv
import io
import json
import math
from collections.abc import Mapping
from dataclasses import asdict, replace
from fractions import Fraction
from pathlib import Path
from typing import Any

import click

from . import gain_file
from .cli import NOT_PROVED, PROVED
from .commands import explain
from .errors import InvalidInputError
from .files import check_writable, write_text
from .machine_again import machine_of
from .machine_design import MachineDesign, design_machine, exchanged, figures_data, rejected_machine
from .machine_file import assumed_text
from .machine_gains import covered, machine_scenarios
from .machine_loop import MachineFigures, MachineLoop, MachineTrace
from .machine_problem import MachineProblem, assemble_machine
from .machine_study import MachineStudy
from .progress import bar
from .selection import Options
from .study import nearest


def run_machine_design(study: MachineStudy, target: Path, options: Options, exchange: tuple[Path, str] | None) -> int:
    """`hdmm-opt design` of a machine.

    Args:
        study: The study.
        target: Gain file to write.
        options: Seed, processes, budget, state.
        exchange: A proved file and the joint whose actuator is another in this study; only that one is proved anew.
    """
    rejected = target.with_name(target.name.removesuffix(".json").removesuffix(".gains") + ".rejected.json")
    with bar() as progress:
        if exchange is None:
            result = design_machine(study, options, progress)
        else:
            document = _proved_machine(exchange[0])
            result = exchanged(document, study, exchange[1], options, progress)
    if result.document is None:
        write_text(rejected, gain_file.to_text(rejected_machine(result)))
        explain(study.study.name, result, rejected, lambda: _simulated(result))
        if target.exists():
            click.echo(f"  {target} is from an earlier run, not of this design; it was left as it is", err=True)
    else:
        write_text(target, gain_file.to_text(result.document))
        rejected.unlink(missing_ok=True)
        _summary(result)
        click.echo(str(target))
    if options.state is not None:
        options.state.unlink(missing_ok=True)
    return NOT_PROVED if result.document is None else PROVED


def _proved_machine(path: Path) -> dict[str, Any]:
    from stability import checker

    report = checker.check_file(path)
    if report.status != PROVED:
        raise InvalidInputError(f"{path}: {report.message}; an actuator is exchanged in a proved file")
    document = gain_file.read(path)
    if "joints" not in document:
        raise InvalidInputError(f"{path}: is the file of one actuator; give that of a machine")
    return document


def _simulated(result: MachineDesign) -> None:
    click.echo("what simulation says (it proves nothing):", err=True)
    _figures(result.problem, result.shown)


def _figures(problem: MachineProblem, shown: Mapping[str, MachineFigures]) -> None:
    inside = {s.name: covered(problem, s) for s in machine_scenarios(problem.study)}
    for name, m in shown.items():
        note = "" if inside.get(name, True) else "  (outside the assumptions)"
        if math.isfinite(m.lost):
            click.echo(f"  {name}: lost at {m.lost:.3g} s{note}", err=True)
            continue
        units = (axis.plant.state_units[0] for axis in problem.axes)
        parts = ", ".join(
            f"{joint} {1e3 * e:.4g} m{unit}"
            for joint, e, unit in zip(problem.machine.joints, m.joints, units, strict=True)
        )
        click.echo(f"  {name}: tool {1e3 * m.tool_late:.4g} mm; {parts}{note}", err=True)


def _summary(result: MachineDesign) -> None:
    document, report, problem = result.document, result.report, result.problem
    assert document is not None and report is not None
    click.echo(report.message, err=True)
    for o in report.obligations:
        if ": " not in o.name:
            click.echo(f"  {o.verdict:8} {o.name:12} margin {o.margin:.4g} {o.unit}: {o.statement}", err=True)
    shown = document["validation"]
    bound = float(Fraction(document["certificate"]["envelope"]["tool"]))
    late = shown["largest_error_after_transient_m"]
    ratio = f": ratio {bound / late:.3g}" if late > 0 else ""
    click.echo(
        f"certified tool error {bound * 1e3:.4g} mm, largest simulated {late * 1e3:.4g} mm in "
        f"{shown['simulated_runs']} runs{ratio}",
        err=True,
    )
    for name, entry in shown["joints"].items():
        certificate = document["joints"][name]["certificate"]
        certified, seen = float(Fraction(certificate["envelope"]["ball"][0])), entry["after_transient"]
        click.echo(f"  {name}: certified {certified * 1e3:.4g} m{entry['unit']}, simulated {seen * 1e3:.4g}", err=True)
        if name in shown["estimates"]:
            noise = document["joints"][name]["study"]["uncertainty"]["noise"]["speed"]
            seen = shown["estimates"][name]["speed"]
            click.echo(f"    speed estimate: certified {noise * 1e3:.4g} mm/s, simulated {seen * 1e3:.4g}", err=True)
    _figures(problem, result.shown)
    click.echo(f"assumed, to be replaced by yours: {assumed_text(problem)}", err=True)


def run_machine_simulate(
    path: Path, document: dict[str, Any], name: str | None, csv_path: Path | None, as_json: bool
) -> int:
    """`hdmm-opt simulate` of a machine's file."""
    problem, gains = machine_of(document)
    offered = {s.name: s for s in machine_scenarios(problem.study)}
    for entry in document["obligations"]:
        if entry.get("witness"):
            offered["witness"] = offered[entry["witness"]["scenario"]["name"]]
    if name is not None and name not in offered:
        raise InvalidInputError(f'{path}: no scenario "{name}"; {nearest(name, offered)}')
    chosen = [name] if name is not None else list(offered)
    if csv_path is not None:
        if len(chosen) > 1:
            raise InvalidInputError(f"--csv writes one scenario; choose one with --scenario: {', '.join(offered)}")
        check_writable(csv_path)
    loop = MachineLoop(problem)
    found = dict(zip(chosen, loop.figures([(gains, offered[key]) for key in chosen]), strict=True))
    if csv_path is not None:
        write_text(csv_path, _csv(problem, loop.trace(gains, offered[chosen[0]])))
    if as_json:
        plain = {key: figures_data(m) for key, m in found.items()}
        click.echo(json.dumps(plain, indent=1))
    else:
        for key, m in found.items():
            click.echo(key)
            for field, value in asdict(m).items():
                values = value if isinstance(value, tuple) else (value,)
                click.echo(f"  {field:12} " + " ".join(f"{v:.6g}" if isinstance(v, float) else str(v) for v in values))
    study = problem.study.requirements
    missed = []
    for key, m in found.items():
        if not covered(problem, offered[key]):
            click.echo(f"{key} has a fault outside the assumptions of the proof: no requirement applies", err=True)
        elif not m.tool_late <= study.tool_error_m:
            missed.append(f"{key}: the tool reaches {1e3 * m.tool_late:.4g} mm of {1e3 * study.tool_error_m:g} mm")
    for line in missed:
        click.echo(f"requirement missed: {line}", err=True)
    return NOT_PROVED if missed else PROVED


def _csv(problem: MachineProblem, trace: MachineTrace) -> str:
    columns: dict[str, Any] = {"time [s]": trace.t}
    for k, (name, axis) in enumerate(zip(problem.machine.joints, problem.axes, strict=True)):
        unit = axis.plant.state_units[0]
        columns |= {f"{name} [{unit}]": trace.x[k], f"{name} reference [{unit}]": trace.r[k]}
    first = 0
    for name, axis in zip(problem.machine.joints, problem.axes, strict=True):
        for key in axis.plant.inputs:
            columns[f"{name} {key} [{axis.plant.input_unit}]"] = trace.u[first]
            first += 1
    for k, letter in enumerate("xyz"[: len(trace.tool)] if len(trace.tool) > 2 else "xz"):
        columns |= {f"tool {letter} [m]": trace.tool[k], f"tool reference {letter} [m]": trace.wanted[k]}
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(columns)
    writer.writerows(zip(*(values.tolist() for values in columns.values()), strict=True))
    return text.getvalue()


def run_machine_trajectory(study: MachineStudy, output: Path | None) -> int:
    """`hdmm-opt trajectory` of a machine: the references of the actuators, and the loads along them."""
    problem = assemble_machine(study)
    moves, duration = len(study.reference.waypoints) - 1, problem.axes[0].reference.duration
    click.echo(f"{study.study.name}: {moves} moves, {duration:.4g} s")
    foreseen = problem.loads.foreseen(problem.slices)
    rows = zip(problem.machine.joints, problem.axes, foreseen, problem.machine.own, strict=True)
    for name, axis, (load, _), own in rows:
        unit, (position, speed, acceleration, _) = axis.plant.state_units[0], axis.reference.bounds()
        click.echo(
            f"  {name:10} {position[0]:.4g} to {position[1]:.4g} {unit}, speed {max(map(abs, speed)):.3g}, "
            f"acceleration {max(map(abs, acceleration)):.3g}"
        )
        click.echo(
            f"  {'':10} load {load.low:.4g} to {load.high:.4g} {axis.plant.load_unit} beside an inertia of {own:g}"
        )
    if output is not None:
        data = {
            name: gain_file.reference_data(axis.reference)
            for name, axis in zip(problem.machine.joints, problem.axes, strict=True)
        }
        write_text(output, gain_file.to_text({"joints": data}))
        click.echo(str(output))
    return PROVED


def run_compare(study: Any, output: Path | None, options: Options) -> int:
    """`hdmm-opt compare`."""
    from .compare import SCHEMA, compare, table
    from .pipeline import FULL

    if not isinstance(study, MachineStudy):
        raise InvalidInputError(
            f"{study.study.name}: rivals are built for machines of several joints (crane, arm with a controller): got "
            "one actuator or a motion; use arm-p3 or crane-p4"
        )
    if output is not None:
        check_writable(output)
    problem = assemble_machine(study)
    budget = (FULL.population, FULL.iterations) if options.full else (study.tuning.population, study.tuning.iterations)
    seed = study.tuning.seed if options.seed is None else options.seed
    with bar() as progress:
        found = compare(problem, budget, seed, replace(options, state=None), progress)
    inside = [s.name for s in machine_scenarios(study) if covered(problem, s)]
    table(found, inside, click.echo)
    each = budget[0] * (budget[1] + 1)
    click.echo(f"{each} candidates for each, on the same scenarios; * least RMS error of the tool", err=True)
    click.echo(f"assumed, to be replaced by yours: {assumed_text(problem)}", err=True)
    if output is not None:
        rows = [
            {"name": c.name, "gains": dict(c.gains), "cost": c.cost if math.isfinite(c.cost) else None,
             "candidates": c.evaluations, "certified_m": c.certified,
             "scenarios": {k: figures_data(m) for k, m in c.figures.items()}}
            for c in found
        ]  # fmt: skip
        data = {"schema": SCHEMA, "study": study.model_dump(mode="json", exclude_none=True), "controllers": rows}
        write_text(output, gain_file.to_text(data))
        click.echo(str(output))
    return PROVED
