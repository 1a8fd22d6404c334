"""An HTML report of a gain file or of a refusal: verdict, limits, errors, motion, assumptions, obligations."""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from stability import checker

from ..errors import InvalidInputError
from ..plants import SOURCES
from ..problem import Problem
from .animation import frames
from .page import PAGE
from .pictures import Pictures, figure_of, pictures, shares
from .read import certified_of, rejected
from .restore import restored
from .seal import to_text
from .sections import assumptions_data, gains_data
from .sources import bundled_text
from .statistics import clopper_pearson
from .text import upward, write_text
from .words import plain

#: Name of the page in its folder.
PAGE_NAME = "report.html"


def check_report() -> None:
    """Refuse a report whose libraries are not installed.

    Raises:
        InvalidInputError: they are not.
    """
    try:
        import jinja2
        import plotly

        _ = jinja2, plotly
    except ImportError:
        raise InvalidInputError("a report needs jinja2 and plotly: pip install jinja2 plotly") from None


def write_report(document: Mapping[str, Any], folder: Path, verdict: checker.Report | None = None) -> Path:
    """Write `report.html` for a gain file or for what a refused design left behind.

    Args:
        document: The file.
        folder: An existing folder.
        verdict: The checker's verdict on a gain file; where None it is checked here.

    Returns:
        The page.

    Raises:
        InvalidInputError: the report libraries are not installed.
    """
    check_report()
    from jinja2 import Environment

    problem, gains = restored(document)
    prefix = {m.name: f"{m.name}: " if len(problem.members) > 1 else "" for m in problem.members}
    verdict = None if rejected(document) else verdict or checker.check_text(to_text(dict(document)))
    proved = verdict is not None and verdict.status == 0
    made = pictures(document, problem, gains)
    text = Environment(autoescape=True).from_string(PAGE).render(
        title=problem.study.study.name, name=problem.study.study.name,
        summary=problem.study.study.summary, proved=proved, upward=upward,
        sentence=_sentence(document, problem, verdict), refusals=_refusals(document),
        bars=_bars(problem, made, verdict), sections=_sections(made), animation=_animation(problem, made),
        worst=_worst(document, problem.machine.output_unit), bundled=bundled_text(problem),
        parameters=_parameters(problem, prefix),
        assumptions=_assumptions(document, problem, prefix), sha=document.get("sha256"), rate=_rates(problem),
        requirements=document["validation"]["requirements"] if proved else [], drawn=_drawn(document),
        obligations=_obligations(verdict),
        gains=[{"member": prefix[m.name], **g} for m in problem.members for g in gains_data(m, gains[m.name])],
    )  # fmt: skip
    target = folder / PAGE_NAME
    write_text(target, text)
    return target


def _rates(problem: Problem) -> str:
    return ", ".join(f"{rate:g}" for rate in sorted({1 / m.bounds.period for m in problem.members}))


def _sentence(document: Mapping[str, Any], problem: Problem, verdict: checker.Report | None) -> str:
    """The verdict in one sentence."""
    if verdict is None:
        return "no gain file was written. What failed, and what would help, stands below."
    if verdict.status:
        return verdict.message
    alone = "the rod" if problem.study.plant.model == "pmsm_emla" else "the output"
    alone = "every member" if len(problem.members) > 1 else alone
    what = alone if problem.loads is None else "the tool"
    bound = f"{upward(1e3 * certified_of(document))} m{problem.machine.output_unit}"
    shown = document["validation"]
    late = 1e3 * shown["largest_error_after_transient_m"]
    return (
        f"from {problem.study.validation.transient_s:g} s on {what} is never further than {bound} from its reference, "
        f"and no limit is passed, for every load, disturbance, parameter and start inside the assumptions below, at "
        f"{_rates(problem)} Hz. Largest in {shown['simulated_runs']} simulated runs: "
        f"{late:.4g} m{problem.machine.output_unit}."
    )


def _refusals(document: Mapping[str, Any]) -> list[dict[str, Any]]:
    """What failed of a refused design."""
    if not rejected(document):
        return []
    rows = [
        {"verdict": o["verdict"], "label": f"{o['member']} {o['name']}".strip(), "statement": o["statement"],
         "remedy": o["remedy"], "plain": plain(o["name"])}
        for o in document["obligations"]
    ]  # fmt: skip
    rows += [
        {"verdict": "refused", "label": "requirement missed", "statement": line, "remedy": "", "plain": ""}
        for line in document.get("missed", [])
    ]
    return rows


def _bars(problem: Problem, made: Pictures, verdict: checker.Report | None) -> list[dict[str, Any]]:
    """Every limit: what is certified and what was simulated, as shares."""
    certified = {(u.member, u.name): u.share for u in verdict.uses} if verdict is not None else {}
    simulated, rows = shares(made.shown, problem), []
    for member in problem.members:
        prefix = f"{member.name} " if len(problem.members) > 1 else ""
        low, high = member.plant.stroke
        sizes = {limit.name: f"{limit.value:.4g} {limit.unit}".removesuffix(" 1") for limit in member.plant.limits}
        sizes["stroke"] = f"{low:.4g} to {high:.4g} {member.plant.state_units[0]}"
        for name, size in sizes.items():
            share, seen = certified.get((member.name, name)), simulated.get((member.name, name), 0.0)
            rows.append({
                "label": f"{prefix}{name}", "limit": size, "simulated": f"{100 * seen:.3g} %",
                "simulated_width": f"{min(100 * seen, 100):.1f}",
                "certified": None if share is None else checker.percent(share, up=True),
                "certified_width": None if share is None else f"{min(100 * share, 100):.1f}",
            })  # fmt: skip
    return rows


def _sections(made: Pictures) -> list[tuple[str, list[Any]]]:
    """The figures as HTML; the library comes with the first."""
    from markupsafe import Markup

    found, first = [], True
    for title, panels in made.sections.items():
        drawn = []
        for panel in panels:
            drawn.append(Markup(figure_of(panel, made.shown).to_html(
                full_html=False, include_plotlyjs=first, config={"responsive": True, "displayModeBar": False},
            )))  # fmt: skip
            first = False
        found.append((title, drawn))
    return found


def _animation(problem: Problem, made: Pictures) -> dict[str, Any] | None:
    """The sticks of a machine along the first run inside the assumptions."""
    from markupsafe import Markup

    run = next((r for r in made.shown if r.kind != "outside"), made.shown[0])
    data = frames(problem, run.trace)
    if data is None:
        return None
    return {**data, "name": run.name, "json": Markup(json.dumps({key: data[key] for key in ("t", "real", "wanted")}))}


def _worst(document: Mapping[str, Any], unit: str) -> dict[str, Any] | None:
    """The worst run that was found, or the witness of a refutation."""
    if rejected(document):
        witness = next((o["witness"] for o in document["obligations"] if o.get("witness")), None)
        if witness is None:
            return None
        scenario, text = witness["scenario"], "A run inside the assumptions that shows the failure."
        return {"title": "Witness", "text": text, "rows": _scenario(scenario)}
    found = document["validation"]["worst_case"]
    if found is None:
        return None
    late = found["figures"]["maximum_error_m"]
    text = f"Error of {1e3 * (late or 0.0):.4g} m{unit}, inside what is certified."
    return {"title": "The worst run that was found", "text": text, "rows": _scenario(found["scenario"])}


def _scenario(scenario: Mapping[str, Any]) -> list[tuple[str, str]]:
    """What a run meets, in words."""
    rows = []
    for name, course in scenario["disturbances"].items():
        shown = ", ".join(f"{value:.4g} at {t:.3g} s" for t, value in course[:12])
        rows.append((name.replace("_", " "), shown + (", ..." if len(course) > 12 else "")))
    for name, share in scenario["parameters"].items():
        rows.append((name.replace("_", " "), f"{100 * share:+.3g} % of its tolerance"))
    for key in ("noise", "bias", "initial", "quantisation"):
        if scenario[key]:
            rows.append((key, f"{100 * scenario[key]:.3g} % of what is assumed"))
    rows += [(f"fault of {name}", f"{100 * f['share']:.3g} % from {f['start_s']:g} s on")
             for name, f in scenario["faults"].items()]  # fmt: skip
    return rows


def _drawn(document: Mapping[str, Any]) -> str:
    """How many of the random runs met every requirement."""
    found = document.get("validation", {}).get("monte_carlo")
    if not found:
        return ""
    least = 100 * clopper_pearson(found["met"], found["runs"])["lower"]
    return (
        f"{found['met']:g} of {found['runs']:g} random runs met every requirement: 95 % sure of {least:.4g} % or more."
    )


def _obligations(verdict: checker.Report | None) -> list[dict[str, Any]]:
    """What the checker decided, with plain words."""
    if verdict is None:
        return []
    return [
        {"label": f"{o.member}: {o.name}" if o.member else o.name, "verdict": o.verdict,
         "margin": checker.downward(o.margin), "unit": o.unit, "statement": o.statement, "plain": plain(o.name)}
        for o in verdict.obligations
    ]  # fmt: skip


def _parameters(problem: Problem, prefix: Mapping[str, str]) -> list[dict[str, Any]]:
    """Parameters, ratings and limits of all members, the assumed first."""
    order = {source: k for k, source in enumerate(("assumed", *(s for s in SOURCES if s != "assumed")))}
    found = []
    for m in problem.members:
        for name, p in {**m.plant.parameters, **m.plant.ratings}.items():
            tolerance = p.tolerance if name in m.plant.parameters else None
            found.append({"member": prefix[m.name], "name": name.replace("_", " "), "value": p.value, "unit": p.unit,
                          "tolerance": tolerance, "source": p.source, "meaning": p.meaning})  # fmt: skip
        for limit in m.plant.limits:
            found.append({"member": prefix[m.name], "name": f"limit on {limit.name}", "value": limit.value,
                          "unit": limit.unit, "tolerance": None, "source": limit.source,
                          "meaning": f"of {', '.join(limit.signals)}"})  # fmt: skip
    return sorted(found, key=lambda p: order[p["source"]])


def _assumptions(
    document: Mapping[str, Any], problem: Problem, prefix: Mapping[str, str]
) -> list[dict[str, Any]]:  # fmt: skip
    """What is assumed besides parameters: of the file, or of the study where there is no proof."""
    given = {entry["name"]: entry.get("assumptions") for entry in document["members"]}
    found = [
        {"member": prefix[m.name], **a}
        for m in problem.members for a in given[m.name] or assumptions_data(m)
        if not a["name"].startswith("parameter.")
    ]  # fmt: skip
    strokes = [
        {"member": prefix[m.name], "name": "stroke", "lower": m.plant.stroke[0], "upper": m.plant.stroke[1],
         "unit": m.plant.state_units[0], "source": "study"}
        for m in problem.members
    ]  # fmt: skip
    return found + strokes
