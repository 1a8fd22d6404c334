"""What a design says: what failed and what would do, or what is proved and at what price."""

from __future__ import annotations

import math
from pathlib import Path
from typing import TYPE_CHECKING

import click

from .statuses import PROVED

if TYPE_CHECKING:
    from ..files.result import Design


def explain(result: Design, left: Path, target: Path) -> None:
    """Say what failed, by how much, and what would do.

    Args:
        result: A refused design.
        left: What it left behind.
        target: The gain file that was not written.
    """
    done = result.report is not None and result.report.status == PROVED
    what = "proved, but a requirement is missed" if done else "not proved"
    click.echo(f"{result.problem.study.study.name}: {what}; no gain file written", err=True)
    for verdict in result.verdicts:
        margin = f"{verdict.margin:.4g} {verdict.unit}" if math.isfinite(verdict.margin) else "unknown"
        where = f"{verdict.member}: " if verdict.member else ""
        click.echo(f"  {verdict.verdict}: {where}{verdict.name} (margin {margin})", err=True)
        click.echo(f"    {verdict.statement}", err=True)
        if verdict.remedy:
            click.echo(f"    {'would pass' if verdict.sure else 'would help'}: {verdict.remedy}", err=True)
    for line in result.missed[:5]:
        click.echo(f"  requirement missed: {line}", err=True)
    if result.shown is not None:
        click.echo("  what simulation says (it proves nothing):", err=True)
        _runs(result)
    click.echo(f"  details: {left}", err=True)
    if target.exists():
        click.echo(f"  {target} is from an earlier run, not of this design; it was left as it is", err=True)


def _runs(result: Design) -> None:
    from ..simulation import within_assumptions

    problem, shown = result.problem, result.shown
    assert shown is not None
    for scenario, m in shown.runs:
        note = "" if within_assumptions(problem, scenario) else "  (outside the assumptions)"
        if m.diverged:
            click.echo(f"  {scenario.name}: lost at {m.diverged_s:.3g} s{note}", err=True)
            continue
        parts = ", ".join(
            f"{member.name} {1e3 * m.members[member.name].maximum_error:.4g} m{member.plant.state_units[0]}"
            for member in problem.members
        )
        click.echo(
            f"  {scenario.name}: output {1e3 * m.maximum_error_m:.4g} m{problem.machine.output_unit}; {parts}{note}",
            err=True,
        )


def proved(result: Design) -> None:
    """Say what is proved, what simulation shows beside it, and what is assumed."""
    from ..files.junit import label
    from ..files.read import certified_of, ultimate_of
    from ..files.sections import assumed_text
    from ..files.text import upward

    document, report, problem = result.document, result.report, result.problem
    assert document is not None and report is not None
    several = len(problem.members) > 1
    click.echo(report.message, err=True)
    for o in report.obligations:
        if not (several and o.member):
            name = label(o) if several else o.name
            click.echo(f"  {o.verdict:8} {name:12} margin {o.margin:.4g} {o.unit}: {o.statement}", err=True)
    for note in result.notes:
        click.echo(note, err=True)
    shown, bound = document["validation"], certified_of(document)
    late, ratio = shown["largest_error_after_transient_m"], shown["bound_over_simulated"]
    unit = f"m{problem.machine.output_unit}"
    click.echo(
        f"certified error {upward(bound * 1e3)} {unit}, largest simulated {late * 1e3:.4g} {unit} in "
        f"{shown['simulated_runs']} runs" + (f": ratio {ratio:.3g}" if ratio else ""),
        err=True,
    )
    for entry in document["members"] if several else []:
        own, unit = shown["members"][entry["name"]], shown["members"][entry["name"]]["unit"]
        seen, size = own["largest_error_after_transient"], upward(ultimate_of(entry) * 1e3)
        click.echo(f"  {entry['name']}: certified {size} m{unit}, simulated {seen * 1e3:.4g}", err=True)
    _estimates(result)
    for row in shown["requirements"]:
        click.echo(f"  {row['name']}: required {row['required']:g}, simulated {row['simulated']:.4g}", err=True)
    for name, entry in document["study"]["uncertainty"]["disturbances"].items():
        unit = next(d.unit for d in problem.machine.disturbances if d.name == name)
        low, high = entry["range"]
        click.echo(f"for {name} from {low:g} to {high:g} {unit}", err=True)
    click.echo(f"assumed parameters, to be replaced by yours: {assumed_text(problem)}", err=True)


def _estimates(result: Design) -> None:
    """The speed estimates of observers: certified and simulated."""
    from ..files.text import upward

    document = result.document
    assert document is not None
    for entry in document["members"]:
        seen = document["validation"]["members"][entry["name"]].get("estimates")
        if seen:
            plant = result.problem.member(entry["name"]).plant
            speed, unit = plant.states[1], plant.state_units[1]
            bound = next(a["upper"] for a in entry["assumptions"] if a["name"] == f"noise.{speed}")
            told = f"certified {upward(bound * 1e3)} m{unit}, simulated {seen[1] * 1e3:.4g}"
            click.echo(f"  {entry['name']}: speed estimate {told}", err=True)
