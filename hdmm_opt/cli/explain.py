"""What a design says: the verdict first, then what it rests on; or what failed and what would do."""

from __future__ import annotations

import math
from fractions import Fraction
from pathlib import Path
from typing import TYPE_CHECKING, Any

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
    from ..files.words import plain

    done = result.report is not None and result.report.status == PROVED
    what = "proved, but a requirement is missed" if done else "not proved"
    _say(f"{result.problem.study.study.name}: {what}; no gain file written")
    replayed = False
    for verdict in result.verdicts:
        margin = f"{verdict.margin:.4g} {verdict.unit}" if math.isfinite(verdict.margin) else "unknown"
        where = f"{verdict.member}: " if verdict.member else ""
        _say(f"{verdict.verdict}: {where}{verdict.name} (margin {margin})", 2)
        _say(verdict.statement, 4)
        if plain(verdict.name):
            _say(f"(what must hold: {plain(verdict.name)})", 4)
        if verdict.remedy:
            _say(f"{'would pass' if verdict.sure else 'would help'}: {verdict.remedy}", 4)
        replayed = replayed or verdict.witness is not None
    for line in result.missed[:5]:
        _say(f"requirement missed: {line}", 2)
    if result.shown is not None:
        _say("what simulation says (it proves nothing):", 2)
        _runs(result)
    _sources(result)
    _say(f"details: hdmm-opt report {left}", 2)
    if replayed:
        _say(f"the witness: hdmm-opt simulate {left} --scenario witness", 2)
    if target.exists():
        _say(f"{target} is from an earlier run, not of this design; it was left as it is", 2)


def _runs(result: Design) -> None:
    from ..simulation import within_assumptions

    problem, shown = result.problem, result.shown
    assert shown is not None
    for scenario, m in shown.runs:
        note = "" if within_assumptions(problem, scenario) else " (outside the assumptions)"
        if m.diverged:
            _say(f"{scenario.name}: lost at {m.diverged_s:.3g} s{note}", 4)
            continue
        parts = [f"output {1e3 * m.maximum_error_m:.4g} m{problem.machine.output_unit}"]
        for member in problem.members if len(problem.members) > 1 else ():
            size = 1e3 * m.members[member.name].maximum_error
            parts.append(f"{member.name} {size:.4g} m{member.plant.state_units[0]}")
        _say(f"{scenario.name}: {', '.join(parts)}{note}", 4)


def proved(result: Design, *, verbose: bool = False) -> None:
    """Say what is proved, what simulation shows beside it, and what it rests on.

    Args:
        result: A proved design.
        verbose: Whether to show every obligation.
    """
    from stability import checker

    report, document = result.report, result.document
    assert document is not None and report is not None
    _say(f"{result.problem.study.study.name}: {report.message}")
    for line in checker.limit_lines(report):
        _say(line, 2)
    _errors(result, document)
    _requirements(document)
    for name, entry in document["study"]["uncertainty"]["disturbances"].items():
        low, high = entry["range"]
        _say(f"for {name} from {low:g} to {high:g} {entry['unit']}", 2)
    for line in (*_pinned(result), *_rated(result), *(result.notes if verbose else result.notes[-1:]), *result.parts):
        _say(line, 2)
    _sources(result)
    if verbose:
        for line in checker.obligation_lines(report, everything=True):
            click.echo(f"  {line}", err=True)


def _sources(result: Design) -> None:
    """What the study left to the bundled machine, and what is assumed."""
    from ..files.sources import assumed_text, bundled_text, exact_text

    for text in (exact_text(result.problem), bundled_text(result.problem)):
        if text:
            _say(text, 2)
    _say(f"assumed, to be replaced by yours: {assumed_text(result.problem)}", 2)


def _errors(result: Design, document: dict[str, Any]) -> None:
    """Certified and simulated errors of the output, the members, and the speeds that are estimated."""
    from ..files.read import above, certified_of, ultimate_of
    from ..files.text import upward

    problem, shown = result.problem, document["validation"]
    bound, late = certified_of(document), shown["largest_error_after_transient_m"]
    ratio = f" (ratio {bound / late:.3g})" if late > 0 else ""
    unit = f"m{problem.machine.output_unit}"
    _say(
        f"certified error {upward(bound * 1e3)} {unit}, largest in {shown['simulated_runs']} simulated runs "
        f"{late * 1e3:.4g} {unit}{ratio}",
        2,
    )
    for entry in document["members"]:
        bounds = zip(entry["model"]["rows"], entry["certificate"]["envelope"]["ultimate"], strict=True)
        for row, size in bounds:
            if isinstance(row["target"], dict):  # a mode: what it is in the motion asked for, and how far from it
                asked = " + ".join(f"{share:g} {name}" for name, share in row["target"].items())
                _say(f"{row['state']}: certified within {upward(above(size) * 1e3)} m{row['unit']} of {asked}", 4)
    for entry in document["members"] if len(document["members"]) > 1 else []:
        own, plant = shown["members"][entry["name"]], problem.member(entry["name"]).plant
        seen, size = own["largest_error_after_transient"], upward(ultimate_of(entry) * 1e3)
        _say(f"{entry['name']}: certified {size} m{own['unit']}, simulated {seen * 1e3:.4g}", 4)
        if "estimates" in own:
            unit = plant.state_units[1]
            bound = float(Fraction(entry["certificate"]["observed"][1]))
            told = f"certified {upward(bound * 1e3)} m{unit}, simulated {own['estimates'][1] * 1e3:.4g}"
            _say(f"{entry['name']}: speed estimate {told}", 4)


def _requirements(document: dict[str, Any]) -> None:
    """The requirements as a table; those that no run could have missed say so."""
    from ..files.text import upward

    wide = max(len(row["name"]) for row in document["validation"]["requirements"])
    click.echo(f"  {'requirement':{wide}}  {'required':>10}  {'certified':>10}  {'simulated':>10}", err=True)
    for row in document["validation"]["requirements"]:
        certified = "-" if row["certified"] is None else upward(row["certified"])
        line = f"  {row['name']:{wide}}  {row['required']:>10.4g}  {certified:>10}  {row['simulated']:>10.4g}"
        vacuous = row["name"] == "settling_time_s" and row["simulated"] == 0
        click.echo(line + ("  never outside its band" if vacuous else ""), err=True)


def _pinned(result: Design) -> list[str]:
    """Gains that the search left at an end of their range."""
    found = []
    for member in result.problem.members:
        for gain, value in zip(member.ranges, result.gains[member.name], strict=True):
            ends = {"lower": gain.low, "upper": gain.high}
            for end, edge in ends.items() if not gain.fixed else ():
                if abs(value / edge - 1) < PINNED:
                    name = f"{member.name}.{gain.name}" if len(result.problem.members) > 1 else gain.name
                    found.append(f"{name} = {value:g} ({end})")
    return [f"at an end of their range, which may be too narrow: {', '.join(found)}"] if found else []


def _rated(result: Design) -> list[str]:
    """Ratings of the motor that a simulated run passed: they bind nothing in the proof."""
    assert result.shown is not None
    found = {}
    for member in result.problem.members:
        for name, group, output in RATED:
            rating = member.plant.ratings.get(name)
            if rating is None or output not in member.plant.outputs:
                continue
            seen = max((getattr(m.members[member.name], group)[output] for m in result.shown.inside), default=0.0)
            if seen > rating.value:
                where = f"{member.name} " if len(result.problem.members) > 1 else ""
                found[where + name] = f"{where}{name} {rating.value:.4g} {rating.unit}: simulated {seen:.4g}"
    return [f"above a rating, which the proof does not know: {'; '.join(found.values())}"] if found else []


#: Ratings that simulated runs are compared with: name, figures, output.
RATED = (
    ("rated_torque", "rms", "torque"), ("rated_current", "rms", "current"), ("peak_current", "peaks", "current"),
    ("peak_torque", "peaks", "torque"),
)  # fmt: skip
#: A gain this close to an end of its range, relatively, is at it.
PINNED = 0.005


def _say(text: str, indent: int = 0) -> None:
    """A line on stderr, wrapped to 80 columns."""
    import textwrap

    before = " " * indent
    for line in textwrap.wrap(
        text, 79, initial_indent=before, subsequent_indent=f"{before}  ", break_long_words=False, break_on_hyphens=False
    ):
        click.echo(line, err=True)
