"""Two levels of a motion: a leader moves the actuators to efficient operating points, a follower moves the machine.

    leader:    minimise the energy lost in motors, gears and screws over the whole job,
               over the duration of each move and the extension of the telescope at each place of the tool
    follower:  for what the leader says, the smoothest motion, ∫ Σ jerk² dt, inside every limit

For a single move the energy-optimal motion of one level bounds from below what the leader can reach, up to local
optima; the leader starts from it, move by move.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from trajectories import LimitViolatedError, Motion, solve

from ..errors import InvalidInputError
from ..machines.crane_geometry import reach
from ..study.sections import SPANS
from .job import Job, Move
from .sequence import Motions, carried_out

Array = NDArray[np.float64]

#: Size of the leader's first steps: of a duration as a share of where it starts, of an extension as one of its range.
STEP = 0.08


@dataclass(frozen=True, kw_only=True)
class Bilevel:
    """The four ways of a job, and how the leader's search went.

    Attributes:
        ways: "time-optimal", "effort-optimal", "energy-optimal", each on one level, and "leader and follower".
        history: Lost energy, J, of the best decision after each one tried.
    """

    ways: tuple[Motions, ...]
    history: tuple[float, ...]


def bilevel(
    job: Job, evaluations: int = 40, tick: Callable[[int, float], None] | None = None, *, spans: int = SPANS
) -> Bilevel:
    """Solve a job on two levels, and by three single-level programs to compare with.

    Args:
        job: The job; its moves have no places to pass.
        evaluations: Decisions of the leader to try, at the most.
        tick: Called with the number of decisions tried and the best lost energy, J.
        spans: Polynomial pieces of every motion.

    Returns:
        The motions. Every one is inside its limits for all t.

    Raises:
        InvalidInputError: a move with places to pass, a path or a speed, or with another machine than the crane.
        LimitViolatedError: a move that no motion inside the limits makes.

    References:
        Heydari Shahna (2025), publication P-14, for the division into leader and follower; J. A. Nelder and R. Mead
        (1965), The Computer Journal 7, 308-313, for the leader's search; S. Dempe (2002), Foundations of Bilevel
        Programming, ch. 1.

    Not guaranteed: global optimality, on either level.
    """
    if any(move.via or move.path or move.speed for move in job.moves) or job.speed:
        raise InvalidInputError(
            "a bilevel move goes from rest to rest and has no places to pass: got via, a path or a speed; remove them, "
            'or use kind = "bspline"'
        )
    costs = (("time", {"time": 1.0}), ("effort", {"time": 0.0, "effort": 1.0}), ("energy", {"time": 0.0, "loss": 1e-3}))
    ways = [carried_out(job, _cost(job, weights), f"{name}-optimal", spans=spans) for name, weights in costs]
    leader = _Leader(job, ways, tick, spans)
    return Bilevel(ways=(*ways, leader.search(evaluations)), history=tuple(leader.history))


def _cost(job: Job, weights: dict[str, float]) -> Callable[[float], Any]:
    return lambda payload: job.mover.cost(payload=payload, **weights)


class _Leader:
    """The search over durations, in those of the least lossy motions, and extensions, as shares of their range.

    The quickest motions bound the durations from below: no follower is quicker.
    """

    def __init__(
        self, job: Job, ways: Sequence[Motions], tick: Callable[[int, float], None] | None, spans: int
    ) -> None:
        self.job, self.start, self.tick, self.spans = job, ways[-1], tick, spans
        self.durations = np.array([motion.parts["time"] for motion in self.start.motions])
        self.quickest = np.array([motion.parts["time"] for motion in ways[0].motions]) / self.durations
        self.reach = float(job.limits.room[1][2])
        self.history: list[float] = []
        self.best, self.found = np.inf, None

    def search(self, evaluations: int) -> Motions:
        from scipy.optimize import minimize

        ends = [motion.spline.coefficients[-1] for motion in self.start.motions]
        first = np.array(
            [1.0] * len(self.durations)
            + [end[2] / self.reach for end, move in zip(ends, self.job.moves, strict=True) if move.tool is not None]
        )
        moves = len(self.job.moves)
        bounds = [(float(low), self.job.longest / t) for low, t in zip(self.quickest, self.durations, strict=True)]
        bounds += [(0.0, 1.0)] * (len(first) - moves)
        first = np.clip(first, *np.transpose(bounds))
        ends_high = first > np.mean(bounds, axis=1)
        steps = STEP * np.eye(len(first)) * np.where(ends_high, -1, 1)
        minimize(
            self.lost, first, method="Nelder-Mead", bounds=bounds,
            options={"initial_simplex": np.stack([first, *(first + steps)]), "maxfev": evaluations,
                     "xatol": 1e-3, "fatol": 1e-3},
        )  # fmt: skip
        if self.found is None:
            raise LimitViolatedError("the leader found no decision that the follower can carry out; allow longer moves")
        return self.found

    def lost(self, decision: Array) -> float:
        """Lost energy of what the follower makes of a decision, J; huge where it can make nothing."""
        value = 1e12
        try:
            found = self.followed(decision)
            value = found.totals["loss"]
            if value < self.best:
                self.best, self.found = value, found
        except LimitViolatedError:
            pass
        self.history.append(self.best)
        if self.tick is not None:
            self.tick(len(self.history), self.best)
        return value

    def followed(self, decision: Array) -> Motions:
        """The follower: the smoothest motions to the leader's places in the leader's times."""
        motions: list[Motion] = []
        at: Any = np.array(self.job.start)
        durations, extensions = (
            self.durations * decision[: len(self.job.moves)],
            iter(self.reach * decision[len(self.job.moves) :]),
        )
        for move, duration, led in zip(self.job.moves, durations, self.start.motions, strict=False):
            end = np.array(move.joints) if move.tool is None else self.place(move, next(extensions), led)
            cost = self.job.mover.cost(time=0.0, jerk=1.0, payload=move.payload)
            task = self.job.task((at, end), move.payload, cost=cost, duration=float(duration), spans=self.spans)
            motions.append(solve(task))
            at = end
        return Motions(name="leader and follower", job=self.job, motions=tuple(motions))

    def place(self, move: Move, extension: float, led: Motion) -> Array:
        """Joint coordinates at a place of the tool with an extension, near those the leader started from."""
        tool = move.tool
        assert tool is not None
        found = reach(tool, float(extension), led.spline.coefficients[-1])
        if found is None or not self.job.limits.holds(found):
            raise LimitViolatedError(
                f"the tool cannot reach ({tool[0]:g}, {tool[1]:g}) m with an extension of {extension:.4g} m"
            )
        return found
