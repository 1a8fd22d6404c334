"""Pictures of simulated runs: errors inside their certified bounds, motion, inputs, disturbances."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from ..problem import GainSet, Problem
from ..simulation import Loop, Trace, scenarios, within_assumptions
from .read import certified_of, rejected, ultimate_of
from .text import upward

#: Points of a plotted curve.
POINTS = 1500
COLOURS = ("#1f5fa8", "#c8553d", "#3a8f5c", "#8a5fb0", "#b08a2e")
CERTIFIED, LIMIT = "#136f3a", "#999"


def figure(document: Mapping[str, Any], problem: Problem, gains: GainSet) -> Any:
    """A Plotly figure of the scenarios.

    Args:
        document: A gain file, or what a refused design left behind.
        problem: Its problem.
        gains: Its gains.

    Returns:
        The figure: error of the output, then error, position and input of each member, then the disturbances. Its title
        says that assumed parameters are in it.
    """
    from plotly.subplots import make_subplots

    loop, panels = Loop(problem), _panels(problem)
    titles = [title for title, _ in panels]
    plot = make_subplots(rows=len(panels), cols=1, shared_xaxes=True, subplot_titles=titles,
                         vertical_spacing=0.24 / len(panels))  # fmt: skip
    given = scenarios(problem)
    for scenario, colour in zip(given, COLOURS * (1 + len(given) // len(COLOURS)), strict=False):
        trace = loop.trace(gains, scenario)
        name = scenario.name if within_assumptions(problem, scenario) else f"{scenario.name}, outside the assumptions"
        pick = np.linspace(0, trace.t.size - 1, min(POINTS, trace.t.size)).astype(int)
        for row, (_, values) in enumerate(panels, 1):
            plot.add_scatter(
                x=trace.t[pick], y=values(trace)[pick], name=name, legendgroup=name, showlegend=row == 1, row=row,
                col=1, line={"color": colour, "width": 1.5},
            )  # fmt: skip
    if not rejected(document):
        _bounds(plot, document, problem)
    plot.update_xaxes(title_text="time [s]", row=len(panels), col=1)
    title = f"{problem.study.study.name}: simulated, with assumed parameters (see the table)"
    plot.update_layout(height=220 * len(panels) + 80, title=title, template="plotly_white",
                       margin={"t": 80, "l": 60, "r": 20}, legend={"y": 1.0})  # fmt: skip
    return plot


def _panels(problem: Problem) -> list[tuple[str, Any]]:
    """Title and curve of each panel."""
    several = len(problem.members) > 1
    what = f"{'output' if several else 'tracking'} error [m{problem.machine.output_unit}]"
    found: list[tuple[str, Any]] = [(what, lambda trace: 1e3 * trace.error)]
    for member in problem.members:
        unit, name, prefix = member.plant.state_units[0], member.name, f"{member.name}: " if several else ""
        if several:
            found.append((f"{prefix}error [m{unit}]", lambda trace, name=name: 1e3 * trace.members[name].error))
        found.append((f"{prefix}{member.plant.states[0]} [{unit}]", lambda trace, name=name: trace.members[name].x[0]))
        found.append((f"{prefix}input [{member.plant.input_unit}]", lambda trace, name=name: _size(trace, name)))
    for disturbance in problem.machine.disturbances:
        title = f"{disturbance.name.replace('_', ' ')} [{disturbance.unit}]"
        found.append((title, lambda trace, name=disturbance.name: trace.disturbances[name]))
    return found


def _size(trace: Trace, name: str) -> Any:
    u = trace.members[name].u
    return u[0] if len(u) == 1 else np.linalg.norm(u, axis=0)


def _bounds(plot: Any, document: Mapping[str, Any], problem: Problem) -> None:
    """Certified bounds in the panels of errors, limits in those of inputs."""
    several, row = len(problem.members) > 1, 1
    _certified(plot, 1e3 * certified_of(document), row, problem.machine.output_unit, signed=not several)
    for member, entry in zip(problem.members, document["members"], strict=True):
        if several:
            row += 1
            _certified(plot, 1e3 * ultimate_of(entry), row, member.plant.state_units[0], signed=True)
        row += 2
        _level(plot, member.plant.limits[0].value, {"color": LIMIT, "dash": "dot"}, row)


def _certified(plot: Any, bound: float, row: int, unit: str, *, signed: bool) -> None:
    for sign in (1, -1) if signed else (1,):
        _level(plot, sign * bound, {"color": CERTIFIED, "dash": "dash"}, row)
    plot.add_annotation(
        x=0, y=bound, text=f"certified bound {upward(bound)} m{unit}", showarrow=False, xanchor="left",
        yanchor="bottom", font={"color": CERTIFIED}, row=row, col=1,
    )  # fmt: skip


def _level(plot: Any, value: float, line: dict[str, str], row: int) -> None:
    """A horizontal line across one panel."""
    axis = "" if row == 1 else str(row)
    plot.add_shape(type="line", x0=0, x1=1, y0=value, y1=value, xref=f"x{axis} domain", yref=f"y{axis}", line=line)
