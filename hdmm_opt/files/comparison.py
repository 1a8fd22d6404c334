"""An HTML page of a comparison: who is best where, by how much, with which gains; and who has a bound."""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from ..problem import Problem
from .page import HEAD
from .text import upward, write_text

#: Name of the page in its folder.
COMPARISON_NAME = "comparison.html"
#: Decades of error that a bar spans.
DECADES = 4.0

#: Jinja2 template; `write_comparison` fills it in.
PAGE = (
    HEAD
    + """.best { font-weight: 700 } td .track { min-width: 6em; border-right: 0 }
td:first-child, td.n { white-space: nowrap } td .track i { background: var(--run) }
.lost { color: var(--limit) }
</style></head><body>
<h1>{{ name }}: the law and its rivals</h1><p class="soft">{{ summary }}</p>
<p>{{ tuned }}, scored on all runs below. All see the same sensors, delay and limits.
{% if bound %}Proved: the error of <b>{{ law }}</b> is never over {{ bound }} inside the assumptions.{% endif %}
</p>
{% for run in runs %}<h2>{{ run.name }}</h2><p class="soft">{{ run.text }}</p>
<div class="wide"><table><tr><th>controller<th class="n">largest error [{{ unit }}]<th>{{ decades }} decades
<th class="n">least<th class="n">most<th class="n">RMS [{{ unit }}]<th class="n">settled [s]<th class="n">limits
<th class="n">travel<th class="n">certified [{{ unit }}]<th>peaks</tr>
{% for c in run.rows %}<tr{% if c.best %} class="best"{% endif %}><td>{{ c.name }}
<td class="n{% if c.lost %} lost{% endif %}">{{ c.middle }}
<td><div class="track"><i style="width: {{ c.width }}%"></i></div>
<td class="n">{{ c.least }}<td class="n">{{ c.most }}<td class="n">{{ c.rms }}<td class="n">{{ c.settled }}
<td class="n">{{ c.limits }}<td class="n">{{ c.travel }}<td class="n">{{ c.certified }}<td class="n">{{ c.peaks }}</tr>
{% endfor %}</table></div>{% endfor %}
<h2>How each was tuned</h2>
<div class="wide"><table><tr><th>controller<th>gains of the first seed</tr>
{% for c in tunings %}<tr><td>{{ c.name }}<td>{{ c.gains }}</tr>{% endfor %}</table></div>
<p class="soft">Largest error: after the transient, of the seed in the middle; least and most: of all seeds. Limits:
largest share used. Travel: total variation of the input. Peaks: of every output, in SI units;
apart: largest difference between the errors of two members, {{ unit }}. Simulation proves nothing. Assumed, to be
replaced by yours: {{ assumed }}.</p>
</body></html>
"""
)


def write_comparison(
    problem: Problem, found: Sequence[Any], tuned: str, inside: Sequence[str], assumed: str, folder: Path
) -> Path:  # fmt: skip
    """Write `comparison.html`, which needs nothing beside itself.

    Args:
        problem: The problem.
        found: The controllers (`jobs/compare.py`), the law first.
        tuned: How they were tuned, as the beginning of a sentence.
        inside: Names of the scenarios inside the assumptions.
        assumed: What has no public source.
        folder: An existing folder.

    Returns:
        The page.
    """
    from jinja2 import Environment

    study, bound, unit = problem.study, found[0].certified, f"m{problem.machine.output_unit}"
    text = Environment(autoescape=True).from_string(PAGE).render(
        title=f"{study.study.name}: comparison", name=study.study.name, summary=study.study.summary, tuned=tuned,
        law=found[0].name, unit=unit,
        bound=None if bound is None else f"{upward(1e3 * bound)} {unit}", decades=int(DECADES),
        runs=[_run(name, found, inside) for name in found[0].trials[0].figures],
        tunings=[{"name": c.name, "gains": gains_text(c)} for c in found],
        assumed=assumed,
    )  # fmt: skip
    target = folder / COMPARISON_NAME
    write_text(target, text)
    return target


def _run(name: str, found: Sequence[Any], inside: Sequence[str]) -> dict[str, Any]:
    errors = [c.middle(name).maximum_error_m for c in found]
    sound = [error for error in errors if math.isfinite(error)]
    best, worst = min(sound, default=math.nan), max(sound, default=math.nan)
    own = errors[0]
    text = "inside the assumptions" if name in inside else "outside the assumptions, or not the motion of the proof"
    if math.isfinite(own) and own > best > 0:
        winner = found[errors.index(best)].name
        text += f"; {winner} is best, {own / best:.3g} times better than {found[0].name}"
    return {"name": name, "text": text, "rows": [_row(c, name, best, worst, inside) for c in found]}


def _row(c: Any, name: str, best: float, worst: float, inside: Sequence[str]) -> dict[str, Any]:
    m, errors = c.middle(name), c.errors(name)
    error, decades = m.maximum_error_m, 0.0
    if math.isfinite(error) and error > 0:
        decades = DECADES + math.log10(error / worst)
    return {
        "name": c.name, "best": error == best, "lost": not math.isfinite(error), "middle": error_text(error),
        "width": f"{100 * min(max(decades / DECADES, 0.01), 1):.1f}", "least": error_text(errors[0]),
        "most": error_text(errors[-1]), "rms": error_text(m.rms_error_m), "settled": f"{m.settling_time_s:.3g}",
        "limits": f"{m.limit_use:.3g}", "travel": f"{sum(own.travel for own in m.members.values()):,.0f}",
        "certified": upward(1e3 * c.certified) if c.certified is not None and name in inside else "none",
        "peaks": peaks_text(m),
    }  # fmt: skip


def peaks_text(m: Any) -> str:
    """The largest outputs of all members in SI units, and how far the errors of members were apart."""
    peaks: dict[str, float] = {}
    for own in m.members.values():
        for name, value in own.peaks.items():
            peaks[name] = max(peaks.get(name, 0.0), value)
    parts = [f"{name.replace('_', ' ')} {value:.4g}" for name, value in peaks.items()]
    return ", ".join([*parts, *([] if m.spread is None else [f"apart {error_text(m.spread)}"])])


def gains_text(c: Any) -> str:
    """Gains of a controller's first seed in one line."""
    return ", ".join(f"{name} {value:.3g}" for name, value in c.trials[0].gains.items())


def error_text(error: float) -> str:
    """An error of a run in thousandths of its unit."""
    return f"{1e3 * error:.3g}" if math.isfinite(error) else "lost"
