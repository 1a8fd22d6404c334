"""An HTML report of a gain file or of a refusal: verdicts, requirements, assumptions, plots of the simulated runs."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from ..errors import InvalidInputError
from ..plants import SOURCES
from ..problem import Problem
from .page import PAGE
from .pictures import figure
from .read import certified_of, rejected
from .restore import restored
from .sections import assumptions_data, gains_data
from .text import upward, write_text

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
        raise InvalidInputError('a report needs the extra "report": pip install "hdmm-opt[report]"') from None


def write_report(document: Mapping[str, Any], folder: Path) -> Path:
    """Write `report.html` for a gain file or for what a refused design left behind.

    Args:
        document: The file.
        folder: An existing folder.

    Returns:
        The page.

    Raises:
        InvalidInputError: the report libraries are not installed.
    """
    check_report()
    from jinja2 import Environment
    from markupsafe import Markup

    problem, gains = restored(document)
    several = len(problem.members) > 1
    prefix = {m.name: f"{m.name}: " if several else "" for m in problem.members}
    refused = rejected(document)
    study, obligations = problem.study.study, document["obligations"]
    text = Environment(autoescape=True).from_string(PAGE).render(
        name=study.name,
        summary=study.summary,
        proved=not refused,
        upward=upward,
        unit=problem.machine.output_unit,
        first=f"{obligations[0]['name']}: {obligations[0]['statement']}" if obligations else "",
        bound=0.0 if refused else 1e3 * certified_of(document),
        runs="the" if refused else document["validation"]["simulated_runs"],
        late=0.0 if refused else 1e3 * document["validation"]["largest_error_after_transient_m"],
        rate=", ".join(f"{rate:g}" for rate in sorted({1 / m.bounds.period for m in problem.members})),
        assumptions=_assumptions(document, problem, prefix),
        limits=[
            {"member": prefix[m.name], **limit.__dict__} for m in problem.members for limit in m.plant.limits
        ],
        strokes=[
            {"member": prefix[m.name], "low": m.plant.stroke[0], "high": m.plant.stroke[1],
             "unit": m.plant.state_units[0]}
            for m in problem.members
        ],
        sha=document.get("sha256"),
        plots=Markup(figure(document, problem, gains).to_html(full_html=False, include_plotlyjs=True)),
        parameters=_parameters(problem, prefix),
        obligations=obligations,
        requirements=[] if refused else document["validation"]["requirements"],
        gains=[
            {"member": prefix[m.name], **entry} for m in problem.members for entry in gains_data(m, gains[m.name])
        ],
    )  # fmt: skip
    target = folder / PAGE_NAME
    write_text(target, text)
    return target


def _parameters(problem: Problem, prefix: Mapping[str, str]) -> list[dict[str, Any]]:
    """Parameters of all members, the assumed first."""
    order = {source: k for k, source in enumerate(("assumed", *(s for s in SOURCES if s != "assumed")))}
    found = [
        {"member": prefix[m.name], "name": name, "value": p.value, "unit": p.unit, "tolerance": p.tolerance,
         "source": p.source, "meaning": p.meaning}
        for m in problem.members for name, p in m.plant.parameters.items()
    ]  # fmt: skip
    return sorted(found, key=lambda p: order[p["source"]])


def _assumptions(
    document: Mapping[str, Any], problem: Problem, prefix: Mapping[str, str]
) -> list[dict[str, Any]]:  # fmt: skip
    """What is assumed besides parameters: of the file, or of the study where there is no proof."""
    given = {entry["name"]: entry.get("assumptions") for entry in document["members"]}
    return [
        {"member": prefix[m.name], **a}
        for m in problem.members for a in given[m.name] or assumptions_data(m)
        if not a["name"].startswith("parameter.")
    ]  # fmt: skip
