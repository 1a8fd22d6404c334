"""Where everything of a loop lies: symbols and slices of its states and constants, member by member.

Discrete states, member by member: those of the law, commanded input, applied input, errors, those of the observer, the
inputs that wait for their delay, newest first, the last measurement, and those of the monitor.
Constants of a run: by member gains, parameters, spread and offset of the noisy states, quantisation steps, the
fault's share, start, rate, kind, size and stuck input, and the phase of the jitter. Shared columns: each reference with
three derivatives, then foreseen loads.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from stability import Observer

from ..control import Law
from ..control.monitor import Monitor
from ..control.observer import SIZE
from ..problem import Problem
from ..problem.build import observer_at

#: Constants of a fault before its stuck inputs: share, start, rate, kind, size.
FAULT = 5


@dataclass(frozen=True, kw_only=True)
class Part:
    """One member in the loop.

    Attributes:
        index: Its place in the machine.
        name: Its name.
        law: Its law.
        every: It runs at each tick whose number is a multiple of this.
        period: Its control period, s.
        noise: Bounds on its measurement errors. Shape (n,).
        resolution: Steps in which its sensors count. Shape (n,).
        observer: What estimates its position and speed; None where they are measured.
        errors: Number of errors that its law shows.
        waiting: Ticks until a commanded input acts.
        early: Ticks that it may act earlier or later, in every period anew.
        monitor: What shuts its actuator down; None where nothing does.
        x, z, draws, fixed: Slices of its states, discrete states, random draws and constants.
    """

    index: int
    name: str
    law: Law
    every: int
    period: float
    noise: tuple[float, ...]
    resolution: tuple[float, ...]
    observer: Observer | None
    errors: int
    waiting: int
    early: int
    monitor: Monitor | None
    x: slice
    z: slice
    draws: slice
    fixed: slice

    @property
    def noisy(self) -> list[int]:
        """Indices of the states whose measurement is not exact."""
        return [i for i, bound in enumerate(self.noise) if bound > 0]

    def cut(self, column: Any, sizes: Mapping[str, int]) -> dict[str, Any]:
        """Named pieces of a column, symbols or numbers."""
        found, first = {}, 0
        for name, size in sizes.items():
            found[name] = column[first : first + size]
            first += size
        return found

    def discrete(self, z: Any) -> dict[str, Any]:
        """Its discrete states by name: law, commanded, applied, errors, travel, observer, pending."""
        return self.cut(z[self.z], self.discrete_sizes)

    def constants(self, fixed: Any) -> dict[str, Any]:
        """Its constants by name: gains, parameters, spread, offset, grid, fault, phase of the jitter."""
        return self.cut(fixed[self.fixed], self.constant_sizes)

    @property
    def discrete_sizes(self) -> dict[str, int]:
        """Sizes of its discrete states."""
        inputs = len(self.law.plant.inputs)
        return {"law": self.law.states, "commanded": inputs, "applied": inputs, "errors": self.errors,
                "travel": 1,
                "observer": 0 if self.observer is None else SIZE,
                "pending": inputs * (self.waiting + self.early), "seen": 1,
                "monitor": 0 if self.monitor is None else self.monitor.size(self.law.plant)}  # fmt: skip

    @property
    def constant_sizes(self) -> dict[str, int]:
        """Sizes of its constants."""
        plant, noisy = self.law.plant, len(self.noisy)
        return {"gains": len(self.law.schema), "parameters": len(plant.parameters), "spread": noisy, "offset": noisy,
                "grid": len(plant.states), "fault": FAULT + len(plant.inputs),
                "phase": 1 if self.early else 0}  # fmt: skip


def parts_of(problem: Problem, laws: Sequence[Law], period: float) -> list[Part]:
    """The members in the loop, at a tick of the shortest period.

    Args:
        problem: The problem.
        laws: A law for each member; those of the problem or rivals.
        period: Duration of a tick, s.

    A member's period is a multiple of the tick; a shorter one becomes the tick itself.
    """
    made: list[Part] = []
    starts: dict[str, int] = dict.fromkeys(("x", "z", "draws", "fixed"), 0)
    for k, (member, law) in enumerate(zip(problem.members, laws, strict=True)):
        own = max(member.bounds.period, period)
        every = round(own / period)
        nothing = slice(0, 0)
        part = Part(
            index=k, name=member.name, law=law, every=every, period=every * period, noise=member.bounds.noise,
            resolution=member.resolution,
            observer=observer_at(problem.study, every * period), errors=errors_of(law),
            waiting=round(member.bounds.delay / period), early=round(member.bounds.jitter / period),
            monitor=monitor_of(problem, k), x=nothing, z=nothing, draws=nothing, fixed=nothing,
        )  # fmt: skip
        sizes = {"x": len(law.plant.states), "z": sum(part.discrete_sizes.values()), "draws": len(part.noisy),
                 "fixed": sum(part.constant_sizes.values())}  # fmt: skip
        places = {key: slice(starts[key], starts[key] + size) for key, size in sizes.items()}
        made.append(Part(**{**part.__dict__, **places}))
        starts = {key: starts[key] + size for key, size in sizes.items()}
    return made


def monitor_of(problem: Problem, k: int) -> Monitor | None:
    """The monitor of a member, as the study asks for it."""
    section, member = problem.study.controller.monitor, problem.members[k]
    if section is None:
        return None
    ranges = {
        limit.signals[0]: section.limits[limit.name] for limit in member.plant.limits if limit.name in section.limits
    }
    return Monitor(error=section.error, ranges=ranges)


def errors_of(law: Law) -> int:
    """Number of errors that a law shows."""
    import casadi as ca

    plant = law.plant
    x, r, z = ca.SX.sym("x", len(plant.states)), ca.SX.sym("r", 4), ca.SX.sym("z", law.states)
    gains, p, w = ca.SX.sym("g", len(law.schema)), ca.SX.sym("p", plant.p.numel()), ca.SX.sym("w", plant.w.numel())
    return law.step(x, r, z, gains, p, w, 1.0)[2].numel()


def size_of(parts: Sequence[Part], key: str) -> int:
    """Length of a group of symbols."""
    return getattr(parts[-1], key).stop
