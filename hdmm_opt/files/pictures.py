"""Pictures of simulated runs, one panel a figure: errors with their bounds, signals with their limits, the reference.

One colour a meaning: blue a run inside the assumptions, purple the worst that was found, orange a run outside them,
green what is certified, red a limit or a requirement, grey the reference.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..problem import GainSet, Member, Problem
from ..simulation import Run, Trace, within_assumptions
from .read import certified_of, rejected, ultimate_of
from .restore import offered
from .text import upward

Array = NDArray[np.float64]

#: Buckets of a plotted curve; each shows its least and its largest value.
BUCKETS = 500
RUN, WORST, OUTSIDE = ("#1f5fa8", "#4f8fd0", "#2f78c4", "#7fb0e0"), "#7a3fa0", "#d9822b"
CERTIFIED, LIMIT, REFERENCE = "#1a8045", "#c0392b", "#8a8a8a"


@dataclass(frozen=True, kw_only=True)
class Shown:
    """A run with what it is.

    Attributes:
        name: Its scenario.
        trace: Its signals.
        kind: "run", "worst" or "outside" the assumptions.
    """

    name: str
    trace: Trace
    kind: str


@dataclass(frozen=True, kw_only=True)
class Panel:
    """One figure.

    Attributes:
        title: What it shows, with its unit.
        curve: Trace -> values.
        levels: Horizontal lines: value, colour, text.
        reference: Trace -> values that are drawn once, in grey; None for none.
    """

    title: str
    curve: Callable[[Trace], Array]
    levels: tuple[tuple[float, str, str], ...] = ()
    reference: Callable[[Trace], Array] | None = None


@dataclass(frozen=True, kw_only=True)
class Pictures:
    """All panels of a file by section.

    Attributes:
        shown: The runs.
        sections: Title of each section, and its panels.
        assumed: Whether assumed parameters are in them.
    """

    shown: tuple[Shown, ...]
    sections: Mapping[str, Sequence[Panel]] = field(default_factory=dict)
    assumed: bool = True


def pictures(document: Mapping[str, Any], problem: Problem, gains: GainSet) -> Pictures:
    """The runs of a file and what is drawn of them.

    Args:
        document: A gain file, or what a refused design left behind.
        problem: Its problem.
        gains: Its gains.
    """
    shown = []
    for name, (loop, scenario) in offered(document, problem).items():
        run = [Run(gains=gains, scenario=scenario)]
        figures = loop.figures(run)[0] if scenario.ground is not None else None
        inside = within_assumptions(problem, scenario, figures)
        kind = ("worst" if name in ("worst-case", "witness") else "run") if inside else "outside"
        shown.append(Shown(name=name, trace=loop.trace(gains, scenario), kind=kind))
    sections = {
        "Error": _errors(document, problem), "Signals": [p for m in problem.members for p in _limits(problem, m)],
        "Reference": [p for m in problem.members for p in _references(problem, m)], "Loads": _loads(problem),
    }  # fmt: skip
    return Pictures(shown=tuple(shown), sections=sections)


def _errors(document: Mapping[str, Any], problem: Problem) -> list[Panel]:
    """Errors of the output and of every member, with what is certified and what is required."""
    several, proved, unit = len(problem.members) > 1, not rejected(document), problem.machine.output_unit
    required = problem.study.requirements.tracking_error_m
    sizes = {m.name: ultimate_of(e) for m, e in zip(problem.members, document["members"], strict=True) if proved}
    found = [Panel(
        title=f"{'output' if several else 'tracking'} error [m{unit}]", curve=lambda trace: 1e3 * trace.error,
        levels=_bound(certified_of(document) if proved else None, required, unit, signed=not several),
    )]  # fmt: skip
    for member in problem.members if several else ():
        own = member.plant.state_units[0]
        found.append(Panel(
            title=f"{member.name}: error [m{own}]",
            curve=lambda trace, name=member.name: 1e3 * trace.members[name].error,
            levels=_bound(sizes.get(member.name), member.accuracy, own, signed=True),
        ))  # fmt: skip
    return found


def _bound(certified: float | None, required: float, unit: str, *, signed: bool) -> tuple[tuple[float, str, str], ...]:
    """Lines of a bound: certified where there is one, else what is required."""
    size, colour, word = (
        (required, LIMIT, "required") if certified is None else (certified, CERTIFIED, "certified bound")
    )
    text = f"{word} {upward(1e3 * size)} m{unit}"
    lines = [(1e3 * size, colour, text)]
    return (*lines, (-1e3 * size, colour, "")) if signed else tuple(lines)


def _limits(problem: Problem, member: Member) -> list[Panel]:
    """Every limited signal, and torque and current where they are only required."""
    plant, prefix, found = member.plant, problem.prefix(member), []
    for limit in plant.limits:
        found.append(Panel(
            title=f"{prefix}{limit.name} [{limit.unit}]",
            curve=lambda trace, limit=limit: _norm(trace, member, limit.signals),
            levels=((limit.value, LIMIT, f"limit {limit.value:.4g} {limit.unit}"),),
        ))  # fmt: skip
    asked = {"torque": problem.study.requirements.peak_torque_nm, "current": problem.study.requirements.peak_current_a}
    for name, required in asked.items():
        if name in plant.outputs and name not in [limit.name for limit in plant.limits]:
            unit = plant.output_units[name]
            levels = () if required is None else ((required, LIMIT, f"required {required:.4g} {unit}"),)
            curve = lambda trace, name=name: np.abs(trace.members[member.name].outputs[name])  # noqa: E731
            found.append(Panel(title=f"{prefix}{name} [{unit}]", curve=curve, levels=levels))
    return found


def _norm(trace: Trace, member: Member, signals: Sequence[str]) -> Array:
    own, plant = trace.members[member.name], member.plant
    rows = [own.u[plant.inputs.index(s)] if s in plant.inputs else own.x[plant.states.index(s)] for s in signals]
    return np.linalg.norm(np.array(rows), axis=0)


def _references(problem: Problem, member: Member) -> list[Panel]:
    """The first state with its reference and the stroke; speed, acceleration and jerk of the reference."""
    plant, prefix, name = member.plant, problem.prefix(member), member.name
    low, high = plant.stroke
    found = [Panel(
        title=f"{prefix}{plant.states[0]} [{plant.state_units[0]}]", curve=lambda trace: trace.members[name].x[0],
        levels=((low, LIMIT, f"stroke from {low:.4g}"), (high, LIMIT, f"to {high:.4g}")),
        reference=lambda trace: trace.members[name].r[0],
    )]  # fmt: skip
    limits, first = problem.study.reference.limits, 1 if plant.first == "position" else 0
    keys = ("speed", "acceleration", "jerk")
    given = (None,) * 3 if limits is None else (limits.speed_m_s, limits.acceleration_m_s2, limits.jerk_m_s3)
    for order, (what, limit) in enumerate(zip(keys, given, strict=True), first):
        unit = plant.reference_units[order]
        levels = () if limit is None else ((limit, LIMIT, f"limit {limit:.4g} {unit}"), (-limit, LIMIT, ""))
        curve = lambda trace, order=order: trace.members[name].r[order]  # noqa: E731
        found.append(
            Panel(title=f"{prefix}{what} of the reference [{unit}]", curve=curve, levels=levels, reference=curve)
        )
    return found


def _loads(problem: Problem) -> list[Panel]:
    found = []
    for disturbance in problem.machine.disturbances:
        span = problem.disturbance(disturbance.name)
        ends = (span.low, "from"), (span.high, "to")
        levels = tuple((end, CERTIFIED, f"covered {word} {end:.4g}") for end, word in ends)
        found.append(Panel(
            title=f"{disturbance.name.replace('_', ' ')} [{disturbance.unit}]", levels=levels,
            curve=lambda trace, name=disturbance.name: trace.disturbances[name],
        ))  # fmt: skip
    return found


def figure_of(panel: Panel, shown: Sequence[Shown]) -> Any:
    """A panel as a Plotly figure; what is outside the assumptions does not set its scale."""
    from plotly.graph_objects import Figure

    plot, sizes = Figure(), [value for value, _, _ in panel.levels]
    runs = [r for r in shown if r.kind != "outside"] or list(shown)
    only_reference = panel.reference is panel.curve
    for k, run in enumerate([] if only_reference else shown):
        values = panel.curve(run.trace)
        pick = _thinned(values)
        colour = {"run": RUN[k % len(RUN)], "worst": WORST, "outside": OUTSIDE}[run.kind]
        name = f"{run.name}, outside the assumptions" if run.kind == "outside" else run.name
        plot.add_scatter(
            x=_short(run.trace.t[pick]), y=_short(values[pick]), name=name, mode="lines",
            line={"color": colour, "width": 1.5, "dash": "dot" if run.kind == "outside" else "solid"},
        )  # fmt: skip
        if run in runs:
            sizes += [float(values.min()), float(values.max())]
    if panel.reference is not None:
        values = panel.reference(runs[0].trace)
        pick = _thinned(values)
        plot.add_scatter(
            x=_short(runs[0].trace.t[pick]), y=_short(values[pick]), name="reference", mode="lines",
            line={"color": REFERENCE, "width": 1.5, "dash": "dash"},
        )  # fmt: skip
        sizes += [float(values.min()), float(values.max())]
    for value, colour, text in panel.levels:
        plot.add_hline(y=value, line={"color": colour, "dash": "dash" if colour == CERTIFIED else "dot"},
                       annotation_text=text, annotation_font_color=colour, annotation_position="top left")  # fmt: skip
    low, high = min(sizes), max(sizes)
    room = 0.12 * (high - low) or 1.0
    plot.update_layout(
        height=240, title={"text": panel.title, "font": {"size": 14}}, margin={"t": 40, "l": 60, "r": 20, "b": 40},
        xaxis={"title": "time [s]"}, yaxis={"range": [low - room, high + room]}, template="plotly_white",
        paper_bgcolor="rgba(0,0,0,0)", plot_bgcolor="rgba(0,0,0,0)", showlegend=True,
        legend={"orientation": "v", "font": {"size": 11}},
    )  # fmt: skip
    return plot


def _thinned(values: Array) -> NDArray[np.int64]:
    """Places of the least and the largest value of every bucket, and of both ends."""
    if values.size <= 2 * BUCKETS:
        return np.arange(values.size)
    parts = np.array_split(np.arange(values.size), BUCKETS)
    places = {0, values.size - 1}
    for part in parts:
        places |= {int(part[np.argmin(values[part])]), int(part[np.argmax(values[part])])}
    return np.array(sorted(places))


def _short(values: Array) -> list[float]:
    """Numbers in six digits, so that the page stays small."""
    return [float(f"{v:.6g}") for v in values]


def figure(document: Mapping[str, Any], problem: Problem, gains: GainSet) -> Any:
    """The errors of a file in one Plotly figure, for a notebook."""
    made = pictures(document, problem, gains)
    plot = figure_of(made.sections["Error"][0], made.shown)
    plot.update_layout(height=380, title=f"{problem.study.study.name}: simulated, with assumed parameters")
    return plot


def shares(shown: Sequence[Shown], problem: Problem) -> dict[tuple[str, str], float]:
    """The largest share of every limit, and of the stroke, in the runs inside the assumptions, by member and name."""
    found: dict[tuple[str, str], float] = {}
    for run in shown:
        for member in problem.members if run.kind != "outside" else ():
            plant, (low, high) = member.plant, member.plant.stroke
            uses = {limit.name: _norm(run.trace, member, limit.signals).max() / limit.value for limit in plant.limits}
            away = np.abs(run.trace.members[member.name].x[0] - (low + high) / 2).max()
            uses["stroke"] = away / ((high - low) / 2)
            for name, use in uses.items():
                found[member.name, name] = max(found.get((member.name, name), 0.0), float(use))
    return found
