"""An HTML report of a gain file: verdicts, requirements, assumptions, and plots of the simulated runs."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from .errors import InvalidInputError
from .files import write_text
from .gain_file import ball_of, gains_of, reference_of
from .problem import Problem, assemble, study_of
from .simulation import Trace, scenarios

#: Points of a plotted curve.
POINTS = 1500

_PAGE = """<!doctype html>
<html lang="en"><head><meta charset="utf-8"><title>{{ name }}</title>
<style>
body { font: 15px/1.5 system-ui, sans-serif; max-width: 1000px; margin: 2em auto; padding: 0 1em; color: #222 }
table { border-collapse: collapse; margin: 1em 0; width: 100% } td, th { padding: .3em .7em; text-align: left;
border-bottom: 1px solid #ddd; vertical-align: top } th { background: #f4f4f4 } .n { text-align: right }
.assumed { background: #fff3cd } .proved { color: #136f3a; font-weight: 600 } h1 { margin-bottom: 0 }
</style></head><body>
<h1>{{ name }}</h1><p>{{ summary }}</p>
<p><span class="proved">proved</span>: after the transient |tracking error| &le;
{{ "%.4g"|format(bound) }} mm, for every
load, disturbance and parameter inside the assumptions below, at {{ rate }} Hz. Largest error in
{{ runs }} simulated runs: {{ "%.4g"|format(late) }} mm.</p>
{{ plots }}
<h2>Assumed parameters: replace these by yours</h2>
<table><tr><th>parameter<th class="n">value<th>unit<th class="n">tolerance<th>source<th>meaning</tr>
{% for p in parameters %}<tr class="{{ p.source }}"><td>{{ p.name }}<td class="n">{{ "%.6g"|format(p.value) }}
<td>{{ p.unit }}<td class="n">&plusmn;{{ "%.3g"|format(100 * p.tolerance) }} %<td>{{ p.source }}<td>{{ p.meaning }}</tr>
{% endfor %}</table>
<p>Tolerances are assumed wherever the source gives none.</p>
<h2>What else is assumed</h2>
<table><tr><th>quantity<th class="n">from<th class="n">to<th>unit<th>source</tr>
{% for a in assumptions %}<tr><td>{{ a.name }}<td class="n">{{ "%.6g"|format(a.lower + 0) }}
<td class="n">{{ "%.6g"|format(a.upper) }}<td>{{ a.unit }}<td>{{ a.source }}</tr>{% endfor %}
{% for x in limits %}<tr><td>limit on {{ x.name }}<td class="n">0<td class="n">{{ "%.6g"|format(x.value) }}
<td>{{ x.unit }}<td>{{ x.source }}</tr>{% endfor %}
<tr><td>stroke<td class="n">{{ stroke[0] }}<td class="n">{{ stroke[1] }}<td>m<td>plant</tr>
<tr><td>control rate<td class="n">{{ rate }}<td class="n">{{ rate }}<td>Hz<td>study</tr></table>
<p>A positive load pushes the rod back in; noise bounds hold at every sample; initial errors are those of the
subsystems at the start. The statement and its proof have the hash {{ sha }}.</p>
<h2>Obligations</h2>
<table><tr><th>obligation<th>verdict<th class="n">margin<th>unit<th>statement</tr>
{% for o in obligations %}<tr><td>{{ o.name }}<td class="{{ o.verdict }}">{{ o.verdict }}
<td class="n">{{ "%.4g"|format(o.margin) }}<td>{{ o.unit }}<td>{{ o.statement }}</tr>{% endfor %}</table>
<h2>Requirements</h2>
<table><tr><th>requirement<th class="n">required<th class="n">simulated<th class="n">certified</tr>
{% for r in requirements %}<tr><td>{{ r.name }}<td class="n">{{ "%.5g"|format(r.required) }}
<td class="n">{{ "%.5g"|format(r.simulated) }}<td class="n">
{{ "%.5g"|format(r.certified) if r.certified is not none else "" }}</tr>{% endfor %}</table>
<p>Simulated figures agree with the proof; they prove nothing.</p>
<h2>Gains</h2>
<table><tr><th>gain<th class="n">value<th>unit<th>meaning</tr>
{% for g in gains %}<tr><td>{{ g.name }}<td class="n">{{ g.value }}<td>{{ g.unit }}<td>{{ g.meaning }}</tr>
{% endfor %}</table></body></html>
"""


def write_report(document: dict[str, Any], folder: Path) -> Path:
    """Write `report.html` for a proved design.

    Args:
        document: A gain file.
        folder: An existing folder.

    Returns:
        The file.

    Raises:
        InvalidInputError: the report libraries are not installed.
    """
    try:
        from jinja2 import Environment
    except ImportError:
        raise InvalidInputError('--report needs the extra "report": pip install "hdmm-opt[report]"') from None
    study = document["study"]
    parameters = [{"name": name, **p} for name, p in study["plant"]["parameters"].items()]
    order = ("assumed", "derived", "public", "table")
    page = Environment(autoescape=True).from_string(_PAGE)
    text = page.render(
        name=study["study"]["name"],
        summary=study["study"].get("summary", ""),
        bound=1e3 * ball_of(document),
        runs=document["validation"].get("simulated_runs", "the"),
        late=1e3 * document["validation"]["largest_error_after_transient_m"],
        rate=f"{document['controller']['rate_hz']:g}",
        assumptions=[a for a in document["assumptions"] if not a["name"].startswith("parameter.")],
        limits=study["plant"]["limits"],
        stroke=study["plant"]["stroke_m"],
        sha=document["sha256"],
        plots=_markup(figure(document)),
        parameters=sorted(parameters, key=lambda p: order.index(p["source"])),
        obligations=document["obligations"],
        requirements=document["validation"]["requirements"],
        gains=document["gains"],
    )
    target = folder / "report.html"
    write_text(target, text)
    return target


def _markup(plot: Any) -> Any:
    from markupsafe import Markup

    return Markup(plot.to_html(full_html=False, include_plotlyjs=True))


def figure(document: dict[str, Any]) -> Any:
    """A Plotly figure of the scenarios: error inside its certified bound, position, input, load.

    Args:
        document: A gain file.

    Returns:
        The figure. Its title says that assumed parameters are in it.
    """
    from plotly.subplots import make_subplots

    problem = assemble(study_of(document["study"]), reference_of(document))
    gains = gains_of(document)
    runs = [
        (s.name if s.covered else f"{s.name}, outside the assumptions", problem.loop.run(gains, problem.reference, s))
        for s in scenarios(problem.study)
    ]
    bound = 1e3 * ball_of(document)
    titles = ("tracking error [mm]", "position [m]", f"input [{problem.plant.input_unit}]", "load [kN]")
    plot = make_subplots(rows=4, cols=1, shared_xaxes=True, subplot_titles=titles, vertical_spacing=0.06)
    colours = ("#1f5fa8", "#c8553d", "#3a8f5c", "#8a5fb0", "#b08a2e")
    for (name, trace), colour in zip(runs, colours * (1 + len(runs) // len(colours)), strict=False):
        for row, values in enumerate(_signals(problem, trace), 1):
            pick = np.linspace(0, trace.t.size - 1, min(POINTS, trace.t.size)).astype(int)
            plot.add_scatter(
                x=trace.t[pick], y=values[pick], name=name, legendgroup=name, showlegend=row == 1, row=row, col=1,
                line={"color": colour, "width": 1.5},
            )  # fmt: skip
    for sign in (1, -1):
        _level(plot, sign * bound, {"color": "#136f3a", "dash": "dash"}, 1)
    plot.add_annotation(
        x=0, y=bound, text=f"certified bound {bound:.3g} mm", showarrow=False, xanchor="left", yanchor="bottom",
        font={"color": "#136f3a"}, row=1, col=1,
    )  # fmt: skip
    limit = problem.plant.limits[0]
    _level(plot, limit.value, {"color": "#999", "dash": "dot"}, 3)
    plot.update_xaxes(title_text="time [s]", row=4, col=1)
    title = f"{problem.study.study.name}: simulated, with assumed parameters (see the table)"
    plot.update_layout(
        height=900, title=title, template="plotly_white", margin={"t": 80, "l": 60, "r": 20}, legend={"y": 1.0}
    )
    return plot


def _level(plot: Any, value: float, line: dict[str, str], row: int) -> None:
    """A horizontal line across one panel."""
    axis = "" if row == 1 else str(row)
    plot.add_shape(type="line", x0=0, x1=1, y0=value, y1=value, xref=f"x{axis} domain", yref=f"y{axis}", line=line)


def _signals(problem: Problem, trace: Trace) -> tuple[Any, ...]:
    size = trace.u[0] if len(problem.plant.inputs) == 1 else np.linalg.norm(trace.u, axis=0)
    return 1e3 * trace.error, trace.x[0], size, trace.load / 1e3
