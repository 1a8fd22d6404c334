"""Figures of a simulated run, as records that every engine accumulates."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from ..problem import Problem
from .engine.system import Record
from .layout import Part


@dataclass(frozen=True, kw_only=True)
class Settings:
    """What the figures are measured by.

    Attributes:
        transient: Time that error figures leave out, s.
        band: Required error of the output for the settling time, m.
    """

    transient: float
    band: float


@dataclass(frozen=True, kw_only=True)
class Signals:
    """What records are made of, as expressions, member by member.

    Attributes:
        states, errors, commanded, outputs, travels, estimates: Of each member.
        apart: Distance of the output from its reference.
        met_use: Share of the assumptions that a body's loads take; None without one.
        stopped: Whether a monitor has shut an actuator down; None without one.
        t, tau: Time of the tick and since the tick, s.
    """

    states: list[Any]
    errors: list[Any]
    commanded: list[Any]
    outputs: list[dict[str, Any]]
    travels: list[Any]
    estimates: list[Any]
    apart: Any
    met_use: Any
    stopped: Any
    t: Any
    tau: Any


def records(problem: Problem, parts: Sequence[Part], settings: Settings, signals: Signals) -> tuple[Record, ...]:
    """Records of the output, then of each member, named "figure member"."""
    import casadi as ca

    late, apart = signals.t >= settings.transient, signals.apart
    found = [
        Record(name="late", kind="max", value=ca.if_else(late, apart, 0), between=True),
        Record(name="error", kind="max", value=apart, between=True),
        Record(name="outside", kind="max", value=ca.if_else(apart > settings.band, signals.t, -1)),
        Record(name="squares", kind="sum", value=ca.if_else(late, apart**2, 0)),
        Record(name="itae", kind="sum", value=signals.t * apart),
        Record(name="ever outside", kind="max", value=apart > settings.band),
    ]
    if problem.machine.free and len(parts) > 1:
        errors = ca.vertcat(*signals.errors)
        apart = ca.if_else(late, ca.mmax(errors) - ca.mmin(errors), 0)
        found.append(Record(name="spread", kind="max", value=apart, between=True))
    if signals.stopped is not None:
        found.append(Record(name="running", kind="sum", value=ca.logic_not(signals.stopped)))
    if signals.met_use is not None:
        found.append(Record(name="met use", kind="max", value=signals.met_use))
    for i, part in enumerate(parts):
        found += _of_member(part, signals, i, late)
        if part.observer is not None:
            found += [
                Record(name=f"estimated {what} {part.name}", kind="max", value=ca.fabs(signals.estimates[i][2 + k]))
                for k, what in enumerate(("position", "speed"))
            ]
    return tuple(found)


def _of_member(part: Part, signals: Signals, i: int, late: Any) -> list[Record]:
    import casadi as ca

    plant, name, error = part.law.plant, part.name, ca.fabs(signals.errors[i])
    named = {s: signals.states[i][k] for k, s in enumerate(plant.states)}
    named |= {s: signals.commanded[i][k] for k, s in enumerate(plant.inputs)}
    use = ca.SX(0)
    for limit in plant.limits:
        use = ca.fmax(use, _norm([named[s] for s in limit.signals]) / limit.value)
    size = _norm([signals.commanded[i][k] for k in range(len(plant.inputs))])
    found = [
        Record(name=f"error {name}", kind="max", value=error, between=True),
        Record(name=f"late {name}", kind="max", value=ca.if_else(late, error, 0), between=True),
        Record(name=f"squares {name}", kind="sum", value=ca.if_else(late, error**2, 0)),
        Record(name=f"use {name}", kind="max", value=use, between=True),
        Record(name=f"input {name}", kind="max", value=size),
        Record(name=f"travel {name}", kind="max", value=signals.travels[i]),
    ]
    for output, value in signals.outputs[i].items():
        if output == "power":
            found.append(Record(name=f"sum {output} {name}", kind="sum", value=value))
            continue
        found.append(Record(name=f"peak {output} {name}", kind="max", value=ca.fabs(value)))
        found.append(Record(name=f"squares {output} {name}", kind="sum", value=value**2))
    return found


def _norm(parts: list[Any]) -> Any:
    import casadi as ca

    return ca.fabs(parts[0]) if len(parts) == 1 else ca.sqrt(sum(part**2 for part in parts))
