"""Why there is no motion inside the limits: the limit, the place, the amount, and the smallest change that would do."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from .guess import Guess
from .limits import ORDERS, LimitViolatedError
from .program import build
from .solver import assembled, bounds, solver_of
from .spline import Spline
from .task import Limit, Task

Array = NDArray[np.float64]

#: Slacks below this count as none.
NONE = 1e-5


@dataclass(frozen=True, kw_only=True)
class Relaxation:
    """A motion inside limits that give way as little as was found.

    Attributes:
        guess: The motion.
        widened: For each limit that gives way: its place on the motion and what would do, as text.
    """

    guess: Guess
    widened: tuple[str, ...]


def at_rest(task: Task, place: Array) -> str:
    """Quantities that leave their limits where the coordinates rest, as text; empty where all are inside."""
    given = task.quantities
    if given is None:
        return ""
    still = np.zeros_like(place)
    values = np.array(given.function(place, still, still, still)).ravel()
    found = []
    for i, value in enumerate(values):
        for end, beyond in ((given.upper[i], value > given.upper[i]), (given.lower[i], value < given.lower[i])):
            if beyond:
                unit = given.units[i]
                found.append(
                    f"{given.names[i]} is {value:.5g} {unit}, its limit {end:.5g} {unit}: that limit must be wider, "
                    "or the place another"
                )
    return "; ".join(found)


def relaxed(task: Task, start: Guess) -> Relaxation | None:
    """Solve the program in which every limit may give way, for the least sum of widenings; None where that fails."""
    program = build(task, 1.0, relaxed=True)
    solver = solver_of(program)
    x = program.shape.packed(list(start.points), start.durations)
    x[program.shape.size - program.shape.slacks :] = 1.0
    answer = solver(x0=x, lbg=program.lower, ubg=program.upper, **bounds(task, program, start))
    if not solver.stats()["success"]:
        return None
    x = np.array(answer["x"]).ravel()
    slacks = x[program.shape.size - program.shape.slacks :]
    spline, _ = assembled(task, program.shape, x, 0.0)
    times = np.linspace(spline.start, spline.end, 2001)
    found = []
    for index in np.argsort(-slacks):
        limit, slack = program.limits[int(index)], float(slacks[index])
        if slack > NONE:
            least = limit.value + (1.01 * slack + 2e-4) * limit.scale * (limit.side or 1)
            found.append(f"{_where(task, limit, spline, times)}; {least:.4g} {limit.unit} would do")
    points, durations = program.shape.unpacked(x)
    return Relaxation(guess=Guess(points=tuple(points), durations=durations), widened=tuple(found))


def refusal(task: Task, relaxation: Relaxation | None, status: str, shortest: float | None) -> LimitViolatedError:
    """The error for a task without a motion.

    Args:
        task: The task.
        relaxation: What limits would have to give way, all of them together.
        status: What the first attempt ended with.
        shortest: Duration of the quickest motion inside the limits, s; None where none is known.
    """
    admitted = task.duration or task.longest
    remedies = [" and ".join(relaxation.widened)] if relaxation is not None and relaxation.widened else []
    if shortest is not None and shortest > admitted:
        remedies.append(f"with the limits as they are, {1.001 * shortest:.4g} s would do")
    if not remedies:
        remedies.append(f"the search stopped with: {status}; start it from elsewhere, or move the waypoints")
    return LimitViolatedError(f"no motion within {admitted:g} s respects the limits: {'; '.join(remedies)}")


def _where(task: Task, limit: Limit, spline: Spline, times: Array) -> str:
    if limit.side:
        assert task.quantities is not None
        row = task.quantities.values(spline, times)[task.quantities.names.index(limit.name)]
    else:
        order, k = next(
            (order, k)
            for order in ORDERS
            for k in range(len(task.limits.names))
            if task.limits.title(order, k) == limit.name
        )
        row = np.abs(spline(times, order).reshape(len(times), -1)[:, k])
    worst = int(np.argmin(row) if limit.side < 0 else np.argmax(row))
    word = "under" if limit.side < 0 else "over"
    share = 100 * times[worst] / spline.end
    return (
        f"{limit.name} would be {row[worst]:.4g} {limit.unit} at {times[worst]:.3g} s, {share:.0f} % of the way, "
        f"{word} its limit {limit.value:g} {limit.unit}"
    )
