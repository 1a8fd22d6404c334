"""Scenarios: what disturbances, parameters, noise and faults a simulated run meets."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field, replace
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..machines.machine import kind_of
from ..plants import EFFECTIVENESS, Parameter, Plant, healthy
from ..problem import Problem
from .figures import Figures

Array = NDArray[np.float64]
#: Breakpoints (time in s, value), linear between them, constant outside.
Course = tuple[tuple[float, float], ...]


@dataclass(frozen=True, kw_only=True)
class Fault:
    """Something of a member that goes wrong from a time on.

    An actuator that loses effectiveness delivers ``(1 - a(t)) u + a(t) u_stuck`` with
    ``a = share (1 - exp(-rate (t - start)))`` from its start on (Heydari Shahna 2025, P-3). A sensor of a first state
    says ``size`` too much ("bias"), is wrong by up to ``size`` at random besides ("noise"), or says what it said last
    ("frozen"); a first state that is a speed stands still ("blocked": it falls by e in ``size`` seconds).

    Attributes:
        kind: What goes wrong: "actuator", a sensor's "bias" or "noise", "frozen", or "blocked".
        size: How much, in the unit of the first state; for "blocked" a time constant, s.
        share: Lost share of the input in the end, 0 … 1; 1 is stuck.
        start_s: Time at which it begins, s.
        rate_1_s: How fast it grows, 1/s.
        stuck: What the lost share delivers instead, in the unit of the inputs; zero where shorter than the inputs.
    """

    share: float
    start_s: float
    rate_1_s: float
    stuck: tuple[float, ...] = ()
    kind: str = "actuator"
    size: float = 0.0

    def column(self, inputs: int) -> Array:
        """Share, start, rate, number of the kind, size, and what a stuck actuator delivers. Shape (5 + inputs,)."""
        stuck = (*self.stuck, *[0.0] * (inputs - len(self.stuck)))
        return np.array([self.share, self.start_s, self.rate_1_s, KINDS.index(self.kind), self.size, *stuck])

    def to_data(self) -> dict[str, Any]:
        """The fault as JSON data; what is only for sensors where it is one."""
        data = {**asdict(self), "stuck": list(self.stuck)}
        return data if self.kind != "actuator" else {k: v for k, v in data.items() if k not in ("kind", "size")}


#: What may go wrong, by the number that a loop knows it by.
KINDS = ("actuator", "bias", "noise", "frozen", "blocked")
#: Nothing goes wrong.
SOUND = Fault(share=0.0, start_s=0.0, rate_1_s=0.0)


@dataclass(frozen=True, kw_only=True)
class Scenario:
    """One run.

    Attributes:
        name: Name for reports.
        disturbances: Course of each disturbance, by "member.name" or by "name" for all members that meet one of their
            own; the middle of its range where not named.
        parameters: Position of parameters in their tolerance, -1 … 1, by "member.parameter" or by "parameter" for all;
            nominal where not named, and actuators healthy.
        noise: Share of the assumed measurement errors, uniformly distributed, 0 … 1.
        bias: Share of the assumed measurement errors that is constant, -1 … 1; the random part has the rest.
        initial: Position of every member's first error in its assumed range, -1 … 1.
        quantisation: Share of the assumed measurement errors that is the rounding of an encoder, 0 … 1.
        faults: What goes wrong with the actuators, by member.
        ground: Courses of the ground's signals under a machine with a body, which then makes disturbances of its own;
            None where all disturbances have courses.
        seed: Seed of the noise.
    """

    name: str
    disturbances: Mapping[str, Course] = field(default_factory=dict)
    parameters: Mapping[str, float] = field(default_factory=dict)
    noise: float = 0.0
    bias: float = 0.0
    initial: float = 0.0
    quantisation: float = 0.0
    faults: Mapping[str, Fault] = field(default_factory=dict)
    ground: Mapping[str, Course] | None = None
    seed: int = 0

    def parameter(self, member: str, name: str, parameter: Parameter) -> float:
        """The value of a member's parameter."""
        usual = healthy(parameter) if name == EFFECTIVENESS else 0.0
        return parameter.at(self.parameters.get(f"{member}.{name}", self.parameters.get(name, usual)))

    def course(self, name: str) -> Course | None:
        """The course of a disturbance, by "member.name" or by "name" for all; None where it is not named."""
        return self.disturbances.get(name) or self.disturbances.get(kind_of(name))

    def to_data(self) -> dict[str, Any]:
        """The scenario as JSON data."""
        data = asdict(self)
        data["disturbances"] = {name: [list(p) for p in course] for name, course in self.disturbances.items()}
        data["faults"] = {name: fault.to_data() for name, fault in self.faults.items()}
        if self.ground is None:
            del data["ground"]
        else:
            data["ground"] = {name: [list(p) for p in course] for name, course in self.ground.items()}
        return data

    @staticmethod
    def from_data(data: Mapping[str, Any]) -> Scenario:
        """The scenario that `to_data` came from."""
        faults = {name: Fault(**{**f, "stuck": tuple(f["stuck"])}) for name, f in data["faults"].items()}
        courses = {key: _courses(data[key]) for key in ("disturbances", "ground") if data.get(key) is not None}
        return Scenario(**{**data, "faults": faults, **courses})


def _courses(data: Mapping[str, Any]) -> dict[str, Course]:
    return {name: tuple((float(t), float(value)) for t, value in course) for name, course in data.items()}


def scenarios(problem: Problem) -> list[Scenario]:
    """The scenarios of a study."""
    study = problem.study
    return [
        Scenario(
            name=s.name, disturbances=dict(s.disturbances), parameters=s.parameters, noise=s.noise, bias=s.bias,
            initial=s.initial, quantisation=s.quantisation,
            faults={name: Fault(**fault.model_dump()) for name, fault in s.faults.items()},
            ground=None if s.ground is None else dict(s.ground), seed=study.tuning.seed + k,
        )
        for k, s in enumerate(study.validation.scenarios)
    ]  # fmt: skip


def within_assumptions(problem: Problem, scenario: Scenario, figures: Figures | None = None) -> bool:
    """Whether the assumptions of the proof hold a scenario; what a body's loads were is known from its figures.

    Faults may only take effectiveness that is allowed for, and disturbances change no faster than the study says.
    """
    if figures is not None and figures.met_use is not None and not figures.met_use <= 1:
        return False
    if any(abs(share) > 1 for share in (*scenario.parameters.values(), scenario.initial)):
        return False
    for name, course in scenario.disturbances.items():
        rate = problem.rate_of(name)
        if rate is not None and _steepest(course) > rate * (1 + 1e-9):
            return False
    return all(_allowed(problem.member(name).plant, name, fault, scenario) for name, fault in scenario.faults.items())


def _allowed(plant: Plant, name: str, fault: Fault, scenario: Scenario) -> bool:
    if fault.kind != "actuator" or EFFECTIVENESS not in plant.parameters or any(fault.stuck):
        return False
    p = plant.parameters[EFFECTIVENESS]
    low, high = p.ends or (p.value, p.value)
    at = scenario.parameter(name, EFFECTIVENESS, p)
    return low - 1e-12 <= at * (1 - fault.share) and at <= high + 1e-12


def rated(problem: Problem, scenario: Scenario) -> Scenario:
    """The scenario with disturbances that change no faster than the study says."""
    made = {}
    for name, course in scenario.disturbances.items():
        rate = problem.rate_of(name)
        made[name] = course if rate is None else slowed(course, rate)
    return replace(scenario, disturbances=made)


def slowed(course: Course, rate: float) -> Course:
    """The course that follows another one as fast as a rate allows."""
    made, behind = [course[0]], False
    for time, value in course[1:]:
        begin, now = made[-1]
        need = abs(value - now) / rate
        if begin + need > time:
            made.append((time, now + math.copysign(rate * (time - begin), value - now)))
            behind = True
            continue
        if behind and need > 0:
            made.append((begin + need, value))
        if time > made[-1][0]:
            made.append((time, value))
        behind = False
    if behind:
        made.append((made[-1][0] + abs(course[-1][1] - made[-1][1]) / rate, course[-1][1]))
    return tuple(made)


def _steepest(course: Course) -> float:
    slopes = (abs(w - v) / (t - s) if t > s else math.inf for (s, v), (t, w) in pairwise(course) if w != v)
    return max(slopes, default=0.0)


def course_at(course: Course, t: Array) -> Array:
    """A disturbance at given times. Shape of t."""
    times, values = zip(*course, strict=True)
    return np.interp(t, times, values)
