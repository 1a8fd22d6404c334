"""What the verbs do: plain functions that print and return an exit status."""

from __future__ import annotations

import csv
import io
import json
import math
from collections.abc import Callable
from dataclasses import asdict, replace
from pathlib import Path
from typing import Any

import click

from stability import checker

from . import gain_file, pipeline, study, validation
from .cli import NOT_PROVED, PROVED
from .errors import DefectError, InvalidInputError
from .files import check_writable, write_text
from .gain_file import ball_of, gains_of, reference_of
from .machine_study import MachineStudy
from .problem import Problem, assemble, study_of
from .progress import bar
from .selection import Options
from .simulation import ClosedLoop, Fault, Metrics, Run, Scenario, Trace, scenarios
from .state import State

#: Population and iterations of a quick trade-off.
QUICK_TRADEOFF = (32, 25)


def run_design(
    name: str, output: Path | None, report: Path | None, options: Options, exchange: tuple[Path, str] | None = None
) -> int:
    """`hdmm-opt design`."""
    chosen = study.load_any(name)
    target = Path(f"{chosen.study.name}.gains.json") if output is None else output
    if target.suffix != ".json":
        raise InvalidInputError(f"a gain file is named .json: got {target}; give -o another name")
    check_writable(target)
    if isinstance(chosen, MachineStudy):
        if report is not None:
            raise InvalidInputError("--report is made for one actuator so far: leave it out; notebooks show machines")
        from .machine_commands import run_machine_design

        state = target.with_name(f".{target.name}.state")
        return run_machine_design(chosen, target, replace(options, state=state), exchange)
    if exchange is not None:
        raise InvalidInputError("--exchange is for a machine of several joints: leave it out for one actuator")
    chosen = study.load(name)
    rejected = target.with_name(target.name.removesuffix(".json").removesuffix(".gains") + ".rejected.json")
    state = target.with_name(f".{target.name}.state")
    if report is not None:
        _prepare_folder(report)
    with bar() as progress:
        result = pipeline.design(chosen, replace(options, state=state), progress)
    if result.document is None:
        write_text(rejected, gain_file.to_text(pipeline.rejected_document(chosen, result)))
        state.unlink(missing_ok=True)
        explain(chosen.study.name, result, rejected)
        if target.exists():
            click.echo(f"  {target} is from an earlier run, not of this design; it was left as it is", err=True)
        return NOT_PROVED
    write_text(target, gain_file.to_text(result.document))
    rejected.unlink(missing_ok=True)
    state.unlink(missing_ok=True)
    _summary(result)
    if report is not None:
        from .report import write_report

        click.echo(f"report: {write_report(result.document, report)}", err=True)
    click.echo(str(target))
    return PROVED


def _prepare_folder(folder: Path) -> None:
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise InvalidInputError(f"{folder}: cannot make that folder: {error.strerror}; choose another") from None
    check_writable(folder / "report.html")


def explain(name: str, result: Any, left: Path, simulated: Callable[[], None] = lambda: None) -> None:
    """Say what failed, by how much, and what would do.

    Args:
        name: Name of the study.
        result: A refused design, with its report, verdicts and missed requirements.
        left: What it left behind.
        simulated: Called to say what simulations showed, where that is of use.
    """
    proved = result.report is not None and result.report.status == PROVED
    what = "proved, but a requirement is missed" if proved else "not proved"
    click.echo(f"{name}: {what}; no gain file written", err=True)
    for verdict in result.verdicts:
        margin = f"{verdict.margin:.4g} {verdict.unit}" if math.isfinite(verdict.margin) else "unknown"
        click.echo(f"  {verdict.verdict}: {verdict.name} (margin {margin})", err=True)
        click.echo(f"    {verdict.statement}", err=True)
        if verdict.remedy:
            click.echo(f"    {'would pass' if verdict.sure else 'would help'}: {verdict.remedy}", err=True)
    for line in result.missed[:5]:
        click.echo(f"  requirement missed: {line}", err=True)
    simulated()
    click.echo(f"  details: {left}", err=True)


def _summary(result: pipeline.Design) -> None:
    document, report = result.document, result.report
    assert document is not None and report is not None
    click.echo(report.message, err=True)
    for o in report.obligations:
        click.echo(f"  {o.verdict:8} {o.name:12} margin {o.margin:.4g} {o.unit}: {o.statement}", err=True)
    for note in result.notes:
        click.echo(note, err=True)
    shown = document["validation"]
    certified = ball_of(document)
    late, ratio = shown["largest_error_after_transient_m"], shown["bound_over_simulated"]
    click.echo(
        f"certified error {certified * 1e3:.4g} mm, largest simulated {late * 1e3:.4g} mm in "
        f"{shown['simulated_runs']} runs: ratio {ratio:.3g}",
        err=True,
    )
    for row in shown["requirements"]:
        click.echo(f"  {row['name']}: required {row['required']:g}, simulated {row['simulated']:.4g}", err=True)
    for entry in document["assumptions"]:
        if entry["name"].startswith("disturbance."):
            name = entry["name"].partition(".")[2]
            click.echo(f"for {name} from {entry['lower']:g} to {entry['upper']:g} {entry['unit']}", err=True)
    assumed = [k for k, p in document["study"]["plant"]["parameters"].items() if p["source"] == "assumed"]
    click.echo(f"assumed parameters, to be replaced by yours: {', '.join(assumed)}", err=True)


def run_simulate(path: Path, name: str | None, csv_path: Path | None, as_json: bool) -> int:
    """`hdmm-opt simulate`."""
    document = gain_file.read(path)
    if _of_machine(document):
        from .machine_commands import run_machine_simulate

        return run_machine_simulate(path, document, name, csv_path, as_json)
    problem, gains, offered = _from_file(path)
    if name is not None and name not in offered:
        raise InvalidInputError(f'{path}: no scenario "{name}"; {study.nearest(name, offered)}')
    chosen = [name] if name is not None else list(offered)
    if csv_path is not None:
        if len(chosen) > 1:
            raise InvalidInputError(f"--csv writes one scenario; choose one with --scenario: {', '.join(offered)}")
        check_writable(csv_path)
    results: dict[str, Metrics] = {}
    for key in chosen:
        loop, scenario = offered[key]
        (results[key],) = loop.figures([Run(gains=gains, scenario=scenario)], problem.reference)
        if csv_path is not None:
            write_text(csv_path, _csv(problem, loop.run(gains, problem.reference, scenario)))
    if as_json:
        click.echo(json.dumps({key: validation.finite(metrics) for key, metrics in results.items()}, indent=1))
    else:
        for key, metrics in results.items():
            click.echo(key)
            for field, value in asdict(metrics).items():
                click.echo(f"  {field:18} {value:.6g}" if not isinstance(value, bool) else f"  {field:18} {value}")
    outside = [key for key in results if not offered[key][1].covered]
    for key in outside:
        click.echo(f"{key} has a fault: outside the assumptions of the proof, no requirement applies", err=True)
    judged = {key: m for key, m in results.items() if key not in outside}
    missed = [text for key, m in judged.items() for text in validation.missed(problem.study, key, m)]
    for line in missed:
        click.echo(f"requirement missed: {line}", err=True)
    return NOT_PROVED if missed else PROVED


def _of_machine(document: dict[str, Any]) -> bool:
    """Whether a file is that of a machine of several joints."""
    plant = document["study"]["plant"]
    return "joints" in document or plant.get("model") in ("arm", "crane")


def _from_file(path: Path) -> tuple[Problem, tuple[Any, ...], dict[str, tuple[ClosedLoop, Scenario]]]:
    """The problem, the gains and the scenarios that a gain file or a rejected file offers."""
    document = gain_file.read(path)
    problem = assemble(study_of(document["study"]), reference_of(document) if "reference" in document else None)
    offered = {s.name: (problem.loop, s) for s in scenarios(problem.study)}
    worst = document.get("validation", {}).get("worst_case")
    if worst:
        offered["worst-case"] = (problem.loop, _scenario(worst["scenario"]))
    for entry in document["obligations"]:
        if entry.get("witness"):
            loop = replace(problem.loop, period=1 / float(entry["witness"]["rate_hz"]))
            offered["witness"] = (loop, _scenario(entry["witness"]["scenario"]))
    return problem, gains_of(document), offered


def _scenario(data: dict[str, Any]) -> Scenario:
    fault = data.get("fault")
    if fault is not None:
        fault = Fault(**{**fault, "stuck": tuple(fault["stuck"])})
    return Scenario(**{**data, "load": tuple((float(t), float(f)) for t, f in data["load"]), "fault": fault})


def _csv(problem: Problem, trace: Trace) -> str:
    """Signals as CSV, one row a control instant; the header carries the units."""
    plant = problem.plant
    columns: dict[str, Any] = {"time [s]": trace.t, "load [N]": trace.load, "error [m]": trace.error}
    for k, name in enumerate(("position", "speed", "acceleration", "jerk")):
        columns[f"reference {name} [{('m', 'm/s', 'm/s^2', 'm/s^3')[k]}]"] = trace.r[k]
    columns |= {f"{s} [{u}]": row for s, u, row in zip(plant.states, plant.state_units, trace.x, strict=True)}
    columns |= {f"{s} [{plant.input_unit}]": row for s, row in zip(plant.inputs, trace.u, strict=True)}
    columns |= {f"theta_{k + 1}": row for k, row in enumerate(trace.theta)}
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(columns)
    writer.writerows(zip(*(values.tolist() for values in columns.values()), strict=True))
    return text.getvalue()


def run_falsify(path: Path, budget: int, seed: int, *, jobs: int = 1, resume: bool = False) -> int:
    """`hdmm-opt falsify`."""
    from .falsification import contradiction, falsify, stored

    report = checker.check_file(path)
    if report.status != PROVED:
        raise InvalidInputError(f"{path}: {report.message}; only a proved file can be attacked")
    document = gain_file.read(path)
    if _of_machine(document):
        raise InvalidInputError(
            f"{path}: falsify attacks files of one actuator so far: got a machine; use simulate, or draws in design"
        )
    problem, gains, offered = _from_file(path)
    job = {"falsify": document["sha256"], "budget": budget, "seed": seed}
    state = State(path.with_name(f".{path.name}.falsify.state"), job, resume=resume)
    with bar() as progress:
        progress.stage("falsify")
        known = [scenario for _, scenario in offered.values()]
        found = falsify(problem, gains, known, budget, seed, progress.update, jobs=jobs, state=state)
    broken = contradiction(document, found)
    if broken is not None:
        raise DefectError(f"{broken}; please report this file with seed {seed}")
    finished, verdict = gain_file.prove(stored(document, found))
    if verdict.status != PROVED:
        raise DefectError(f"the file is no longer proved with its witness: {verdict.message}")
    # in this order: a file that is attacked already must not be attacked again by a resumed run
    state.remove()
    write_text(path, gain_file.to_text(finished))
    click.echo(f"{found.runs} runs, none outside the certified envelope (that proves nothing more)", err=True)
    late, ball = found.metrics.maximum_error_m, ball_of(document)
    worst = finished["validation"]["largest_error_after_transient_m"]
    click.echo(
        f"worst {1e3 * late:.4g} mm, worst on record {1e3 * worst:.4g} mm, certified {1e3 * ball:.4g} mm: "
        f"ratio {ball / worst:.3g}; at most {100 * found.largest_use:.3g} % of a limit used"
    )
    return PROVED


def run_sweep(name: str, vary: tuple[str, ...], output: Path | None, options: Options) -> int:
    """`hdmm-opt sweep`."""
    from .sweep import SCHEMA, axis, sweep

    chosen = study.load(name)
    axes = [axis(text) for text in vary]
    target = Path(f"{chosen.study.name}.sweep.json") if output is None else output
    if target.suffix != ".json":
        raise InvalidInputError(f"the table of a sweep is named .json: got {target}; give -o another name")
    check_writable(target)
    with bar() as progress:
        rows, state = sweep(chosen, axes, replace(options, state=target.with_name(f".{target.name}.state")), progress)
    document = {"schema": SCHEMA, "study": chosen.model_dump(mode="json", exclude_none=True), "rows": rows}
    write_text(target, gain_file.to_text(document))
    state.remove()
    columns = [a.key for a in axes]
    click.echo(",".join([*columns, "verdict", "certified_error_m", "simulated_error_m"]))
    for row in rows:
        found = [
            row["verdict"],
            *("" if row[k] is None else f"{row[k]:.6g}" for k in ("certified_error_m", "simulated_error_m")),
        ]
        click.echo(",".join([*(f"{row['values'][key]:g}" for key in columns), *found]))
    proved = sum(row["verdict"] == "proved" for row in rows)
    click.echo(f"{proved} of {len(rows)} designs proved; gains and verdicts in {target}", err=True)
    return PROVED


def run_tradeoff(name: str, output: Path | None, options: Options) -> int:
    """`hdmm-opt tradeoff`."""
    from .evaluation import OBJECTIVES
    from .tradeoff import SCHEMA, rows, tradeoff

    chosen = study.load(name)
    if not assemble(chosen).searched:
        raise InvalidInputError(f"{name}: a trade-off needs gains to search: all are fixed; give one min and max")
    target = Path(f"{chosen.study.name}.tradeoff.json") if output is None else output
    if target.suffix != ".json":
        raise InvalidInputError(f"a trade-off is named .json: got {target}; give -o another name")
    check_writable(target)
    state = target.with_name(f".{target.name}.state")
    size = (pipeline.FULL.population, pipeline.FULL.iterations) if options.full else QUICK_TRADEOFF
    with bar() as progress:
        found, kept = tradeoff(chosen, replace(options, state=state), progress, size)
    table = rows(found)
    document = {"schema": SCHEMA, "study": chosen.model_dump(mode="json", exclude_none=True), "rows": table}
    write_text(target, gain_file.to_text(document))
    kept.remove()
    gains = list(table[0]["gains"]) if table else []
    click.echo(",".join([*(f"{name} (share)" for name in OBJECTIVES), *gains]))
    for row in table:
        click.echo(",".join(f"{value:.4g}" for value in (*row["objectives"].values(), *row["gains"].values())))
    click.echo(
        f"{len(table)} proved designs of {found.evaluations} candidates in {target}; none of them is beaten", err=True
    )
    return PROVED if table else NOT_PROVED


def study_row(name: str) -> dict[str, str]:
    """What `hdmm-opt studies` says of a bundled study."""
    chosen = study.load_any(name)
    if isinstance(chosen, MachineStudy):
        machine = f"{chosen.plant.model} ({len(chosen.joints)} joints)"
        kind = " model-based" if chosen.controller.modelling else " model-free"
        law = f"{chosen.controller.law}{kind}, {chosen.controller.rate_hz:g} Hz"
    elif not isinstance(chosen, study.Study):
        machine, law = chosen.plant.model, f"no law: {chosen.reference.kind} motion"
    else:
        machine = f"{chosen.plant.model} ({chosen.plant.level})"
        kind = " model-based" if chosen.controller.modelling else " model-free"
        law = f"{chosen.controller.law}{kind}, {chosen.controller.rate_hz:g} Hz"
    return {"name": name, "machine": machine, "law": law, "shows": chosen.study.summary}


def run_trajectory(name: str, output: Path | None) -> int:
    """`hdmm-opt trajectory`."""
    from .motion import effort_table

    chosen = study.load_any(name)
    if output is not None:
        check_writable(output)
    if isinstance(chosen, MachineStudy):
        from .machine_commands import run_machine_trajectory

        return run_machine_trajectory(chosen, output)
    if not isinstance(chosen, study.Study):
        return _run_motion(chosen, output)
    problem = assemble(chosen)
    moves = sum(1 for s in problem.reference.segments if s.coefficients.min() < s.coefficients.max())
    click.echo(f"{chosen.study.name}: {moves} moves ({chosen.reference.kind}), {problem.reference.duration:.4g} s")
    for row in effort_table(chosen, problem.plant, problem.reference):
        limit = "no limit" if row["limit"] is None else f"limit {row['limit']:g}"
        click.echo(f"  {row['quantity']:13} {row['peak']:10.4g} {row['unit']:6} {limit}")
    if output is not None:
        write_text(output, gain_file.to_text(gain_file.reference_data(problem.reference)))
        click.echo(str(output))
    return PROVED


def _run_motion(chosen: Any, output: Path | None) -> int:
    """The motions of a study without a controller."""
    from trajectories import LimitViolatedError

    from .crane_task import ASSUMED
    from .motion_file import document

    with bar() as progress:
        progress.stage(chosen.study.name)
        try:
            ways = _ways(chosen, progress)
        except LimitViolatedError as error:
            raise InvalidInputError(f"{chosen.study.name}: {error}") from None
    heads = ("time [s]", "energy [J]", "lost [J]", "effort [s]", "efficiency")
    click.echo(f"{'motion':20}" + "".join(f"{head:>12}" for head in heads))
    for way in ways:
        total, share = way.totals, way.efficiency
        click.echo(
            f"{way.name:20}{way.duration:12.4g}{total['energy']:12.5g}{total['loss']:12.5g}"
            f"{total['effort']:12.3g}" + (f"{'-':>12}" if share is None else f"{share:12.3f}")
        )
    click.echo("every motion is inside its limits for all t", err=True)
    click.echo(f"assumed, to be replaced by yours: {', '.join(ASSUMED)}", err=True)
    if output is not None:
        write_text(output, gain_file.to_text(document(chosen, ways)))
        click.echo(str(output))
    return PROVED


def _ways(chosen: Any, progress: Any) -> Any:
    """The motions by the study's kind of reference."""
    from .bilevel import bilevel
    from .crane_task import crane_cost
    from .job import carried_out

    section = chosen.reference
    if section.kind == "bilevel":
        budget = section.evaluations or 24
        return bilevel(
            chosen.job(), budget, lambda done, best: progress.update(done / budget, f"lost {best:.4g} J"),
            spans=section.spans,
        ).ways  # fmt: skip
    weights = {"time": 1.0} if section.cost is None else section.cost.model_dump()
    found = carried_out(
        chosen.job(), lambda payload: crane_cost(payload=payload, **weights), "spline program", spans=section.spans
    )
    return (found,)
