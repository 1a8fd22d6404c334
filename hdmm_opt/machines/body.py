"""What free members move: a body that meets them with loads in simulation, which a proof takes as given."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from ..plants import Parameter


@dataclass(frozen=True, kw_only=True)
class Signal:
    """Something of the ground that a scenario gives a course.

    Attributes:
        name: Its name, "member.name" for that of one member.
        unit: SI unit.
        value: Its value where a scenario does not name it.
        range: What it may be.
        meaning: One line.
    """

    name: str
    unit: str
    value: float
    range: tuple[float, float]
    meaning: str


@dataclass(frozen=True, kw_only=True)
class Body:
    """A body with states of its own, beside members whose first states move it.

    Attributes:
        states, units: Names and units of its states.
        signals: What of the ground a scenario may give.
        parameters: Its numbers.
        met: Names of the disturbances that it makes.
        rate: CasADi function (states, first states of the members, signals) -> states'. Shape (n,).
        loads: CasADi function of the same -> the disturbances `met`. Shape (d,).
        outputs: Further signals as CasADi function of the same; `output_names` has their names and units.
        start: (first states, signals) -> its states at rest relative to the ground that they move over.
        holds: Signals -> what the ground cannot hold, as text; empty where it can.
    """

    states: tuple[str, ...]
    units: tuple[str, ...]
    signals: tuple[Signal, ...]
    parameters: Mapping[str, Parameter]
    met: tuple[str, ...]
    rate: Any
    loads: Any
    outputs: Any
    output_names: Mapping[str, str]
    start: Callable[[list[float], list[float]], list[float]]
    holds: Callable[[list[float]], str]


def ground_at(body: Body, courses: Mapping[str, Any], t: Any) -> Any:
    """The ground's signals at some times: each its own course, that of all of its kind, or its usual value.

    Args:
        body: The body.
        courses: Breakpoints (time in s, value) by "member.name" or by "name".
        t: Times, s. Shape (k,).

    Returns:
        The values. Shape (signals, k).
    """
    rows = []
    for signal in body.signals:
        course = courses.get(signal.name) or courses.get(signal.name.rpartition(".")[2]) or ((0.0, signal.value),)
        times, values = zip(*course, strict=True)
        rows.append(np.interp(t, times, values))
    return np.array(rows)


@dataclass(frozen=True, kw_only=True)
class BodyModel:
    """How a body is made from a study.

    Attributes:
        defaults: Its numbers with units and sources.
        build: Numbers -> the body.
    """

    defaults: Mapping[str, Parameter]
    build: Callable[[Mapping[str, Parameter]], Body]
