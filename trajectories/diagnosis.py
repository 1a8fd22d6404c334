"""Why there is no motion inside the limits: the limit, the place, the amount, and a change that would do."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .guess import Guess
from .limits import ORDERS, LimitViolatedError
from .nodes import TIGHTENING
from .program import build
from .solver import assembled, bounds, solver_of
from .spline import Spline
from .task import Limit, Task, Waypoint

Array = NDArray[np.float64]

#: Share of a limit that a place of rest must leave, because the program keeps half of it.
RESERVE = 2 * TIGHTENING
#: Limits that a message names, the one that gives most first.
SHOWN = 3
#: Slacks below this count as none.
NONE = 1e-5


@dataclass(frozen=True, kw_only=True)
class Widening:
    """A limit that has to give way.

    Attributes:
        limit: The limit.
        slack: How far, in units of its scale, in the program.
        place: What is over or under it, where on the way, as text.
    """

    limit: Limit
    slack: float
    place: str

    def least(self, growth: float) -> float:
        """A wider limit, rounded outwards to four digits; `growth` widens it further."""
        side = self.limit.side or 1
        value = self.limit.value + (1.01 * growth * self.slack + growth * RESERVE) * self.limit.scale * side
        unit = 10.0 ** (math.floor(math.log10(abs(value) or 1.0)) - 3)
        return float(f"{(math.ceil if side > 0 else math.floor)(value / unit) * unit:.6g}")


@dataclass(frozen=True, kw_only=True)
class Relaxation:
    """A motion inside limits that give way as little as was found.

    Attributes:
        guess: The motion.
        widened: The limits that give way, the one that gives most first.
    """

    guess: Guess
    widened: tuple[Widening, ...]

    def task(self, task: Task, growth: float) -> Task:
        """The task with wider limits."""
        sizes = {name: np.array(task.limits.of(order)) for order, name in ORDERS.items()}
        given = task.quantities
        ends = None if given is None else {1: np.array(given.upper), -1: np.array(given.lower)}
        for step in self.widened:
            target = sizes[ORDERS[step.limit.order]] if step.limit.order else (ends or {})[step.limit.side]
            target[step.limit.index] = step.least(growth)
        if given is not None and ends is not None:
            given = replace(given, upper=ends[1], lower=ends[-1])
        return replace(task, limits=replace(task.limits, **sizes), quantities=given)

    @property
    def crowded(self) -> bool:
        """Whether so many limits give way that another remedy is worth more."""
        return len(self.widened) > SHOWN

    def text(self, growth: float | None) -> str:
        """What gives way, and with a `growth` that was confirmed, what would do; of many limits the first alone."""
        parts = []
        for step in self.widened[:SHOWN]:
            would = "" if growth is None or self.crowded else f": {step.least(growth):g} {step.limit.unit} would do"
            parts.append(f"{step.limit.name} {step.place}{would}")
        if self.crowded:
            parts.append(f"{len(self.widened) - SHOWN} more")
        return ", together with ".join(parts)


def at_rest(task: Task, place: Array) -> str:
    """Quantities that leave their limits where the coordinates rest, as text; empty where all are inside."""
    given = task.quantities
    if given is None:
        return ""
    still = np.zeros_like(place)
    values = np.array(given.function(place, still, still, still)).ravel()
    found = []
    for i, value in enumerate(values):
        room = min(RESERVE * given.scale[i], (given.upper[i] - given.lower[i]) / 2)
        for end, beyond in (
            (given.upper[i], value > given.upper[i] - room),
            (given.lower[i], value < given.lower[i] + room),
        ):
            if beyond:
                unit = given.units[i]
                found.append(
                    f"{given.names[i]} is {value:.6g} {unit}, its limit {end:.6g} {unit} less {100 * RESERVE:g} % in "
                    "reserve: that limit must be wider, or the place another"
                )
    return "; ".join(found)


def reject_places(task: Task) -> None:
    """Refuse waypoints outside their ranges, and ends where the machine can neither rest nor move as it is to.

    Raises:
        LimitViolatedError: one of them.
    """
    low, high = task.limits.room
    for waypoint in task.waypoints:
        for k, value in enumerate(waypoint.known):
            if not np.isnan(value) and not low[k] <= value <= high[k]:
                name, unit = f"{task.limits.names[k]} position".strip(), task.limits.units[k]
                raise LimitViolatedError(
                    f"{name} {value:g} {unit} leaves the stroke {low[k]:g}…{high[k]:g} {unit}; move the waypoint"
                )
    for which, waypoint in (("start", task.waypoints[0]), ("goal", task.waypoints[-1])):
        if waypoint.moving:
            _reject_rates(task, which, waypoint)
        elif not np.isnan(waypoint.known).any():
            over = at_rest(task, waypoint.known)
            if over:
                raise LimitViolatedError(f"no motion: at rest at the {which}, {over}")


def _reject_rates(task: Task, which: str, waypoint: Waypoint) -> None:
    """A speed or an acceleration at an end that is over its limit."""
    for order in (1, 2):
        sizes, limits = np.abs(waypoint.rate(order, len(task.limits.names))), task.limits.of(order)
        over = np.flatnonzero(sizes > limits * (1 - TIGHTENING / 2))
        if len(over):
            k = int(over[0])
            unit = task.limits.unit(order, k)
            raise LimitViolatedError(
                f"no motion: at the {which}, {task.limits.title(order, k)} is {sizes[k]:g} {unit}, "
                f"its limit {limits[k]:g} {unit} less {50 * TIGHTENING:g} % in reserve: start it "
                "slower, or widen that limit"
            )


def relaxed(task: Task, start: Guess, options: tuple[tuple[str, Any], ...] = ()) -> Relaxation | None:
    """Solve the program in which every limit may give way, for the least sum of widenings; None where that fails."""
    program = build(task, relaxed=True)
    solver = solver_of(program, options)
    x = program.shape.packed(list(start.points), start.durations)
    x[program.shape.size - program.shape.slacks :] = 1.0
    lower, upper = program.rows(task)
    answer = solver(x0=x, p=1.0, lbg=lower, ubg=upper, **bounds(task, program, start))
    if not solver.stats()["success"]:
        return None
    x = np.array(answer["x"]).ravel()
    slacks = x[program.shape.size - program.shape.slacks :]
    spline, _ = assembled(task, program.shape, x)
    found = []
    for i in np.argsort(-slacks):
        limit, slack = program.limits[i], float(slacks[i])
        if slack > NONE:
            found.append(Widening(limit=limit, slack=slack, place=_place(task, limit, slack, spline)))
    points, durations = program.shape.unpacked(x)
    return Relaxation(guess=Guess(points=tuple(points), durations=durations), widened=tuple(found))


def refusal(
    task: Task, reasons: str, status: str, shortest: float | None, *, crowded: bool = False
) -> LimitViolatedError:
    """The error for a task without a motion.

    Args:
        task: The task.
        reasons: What limits would have to give way; empty where none is known.
        status: What the first attempt ended with.
        shortest: Duration of the quickest motion inside the limits, s; None where none is known.
        crowded: Whether more time is to be named before the limits.
    """
    admitted = task.longest if task.duration is None else task.duration
    remedies = [reasons] if reasons else []
    if shortest is not None and shortest > admitted:
        remedies.insert(
            0 if crowded else len(remedies), f"with the limits as they are, {1.001 * shortest:.5g} s would do"
        )
    if not remedies:
        remedies.append(f"the search stopped with: {status}; start it from elsewhere, or move the waypoints")
    return LimitViolatedError(f"no motion within {admitted:g} s respects the limits: {'; '.join(remedies)}")


def _place(task: Task, limit: Limit, slack: float, spline: Spline) -> str:
    """By how much and where a limit is passed, by the program's value and the samples' place."""
    times = np.linspace(spline.start, spline.end, 2001)
    if limit.order:
        row = np.abs(spline(times, limit.order).reshape(len(times), -1)[:, limit.index])
    else:
        assert task.quantities is not None
        row = task.quantities.values(spline, times)[limit.index]
    worst = int(np.argmin(row) if limit.side < 0 else np.argmax(row))
    word = "under" if limit.side < 0 else "over"
    return (
        f"would be {slack * limit.scale:.3g} {limit.unit} {word} its limit {limit.value:g} {limit.unit} at "
        f"{times[worst]:.3g} s, {100 * times[worst] / spline.end:.0f} % of the way"
    )
