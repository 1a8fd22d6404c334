"""Sections of a gain file."""

from __future__ import annotations

from collections.abc import Iterable
from decimal import ROUND_CEILING, ROUND_HALF_EVEN, Context, Decimal
from fractions import Fraction
from typing import Any

import numpy as np

from stability.certificates.small_gain import Cell
from stability.networks.contracts import Contract
from stability.networks.coupling import Tube
from trajectories import Reference

from ..motions.slices import HALVINGS
from ..plants.sound import program_of
from ..problem import GainSet, Member, Problem
from ..problem.margins import output_bound
from ..problem.member import Values
from ..problem.problem import Contracts
from ..simulation.requirements import MEMBER

#: Significant digits of the certificate's rationals.
DIGITS = 9
#: The same of the coordinates of a cell: rounding must not join what they separate.
FINER = 15
#: Guarantees are written with so much room that rounding them does not break them.
ROOM = 1 + 1e-6
#: Room of a stated bound on a member's error, and on the output's, over what was found: the checker rounds outwards.
ULTIMATE, OUTPUT = 5e-4, 6e-4
#: Share of a rate of decay that a file states.
RATE = 0.999


def reference_data(
    reference: Reference, units: tuple[str, str, str, str] = ("m", "m/s", "m/s^2", "m/s^3")
) -> dict[str, Any]:
    """A reference: splines, and the bounds of its derivatives."""
    names = ("position", "speed", "acceleration", "jerk")
    return {
        "segments": [
            {"degree": 5, "knots": s.knots.tolist(), "coefficients": s.coefficients.tolist()}
            for s in reference.segments
        ],
        "derivative_bounds": [
            {"name": name, "unit": unit, "lower": low, "upper": high}
            for name, unit, (low, high) in zip(names, units, reference.bounds(), strict=True)
        ],
    }


def model_data(member: Member, shared: Iterable[str]) -> dict[str, Any]:
    """Plant and law of a member as operation lists, and what its limits are about."""
    limits = [{"name": limit.name, "signals": list(limit.signals)} for limit in member.plant.limits]
    outputs = outputs_data(member, shared)
    return {**member.model.to_data(), "limits": limits, "first": member.plant.first, "outputs": outputs}


def outputs_data(member: Member, shared: Iterable[str] = ()) -> dict[str, Any]:
    """The outputs that are drawn on together or that a requirement can be about, in operations of a file.

    Those are left out that do not follow from states, inputs and parameters.
    """
    plant, found = member.plant, {}
    wanted = {*(output for _, output in MEMBER.values()), *shared}
    for name in sorted(wanted & set(plant.output_units)):
        program, other = program_of(plant, plant.outputs[name])
        if program is not None and not other and not set(plant.disturbances) & set(program.inputs):
            found[name] = {"unit": plant.output_units[name], "program": program.to_data()}
    return found


def gains_data(member: Member, values: Values) -> list[dict[str, Any]]:
    """The gains of a member."""
    return [
        {"name": item.name, "value": value, "unit": item.unit, "min": item.low, "max": item.high,
         "meaning": item.meaning}
        for value, item in zip(values, member.ranges, strict=True)
    ]  # fmt: skip


def named_gains(problem: Problem, gains: GainSet) -> dict[str, float]:
    """Gains by name, with the member's before it where there are several."""
    several = len(problem.members) > 1
    return {
        f"{m.name}.{item.name}" if several else item.name: value
        for m in problem.members for item, value in zip(m.ranges, gains[m.name], strict=True)
    }  # fmt: skip


def assumptions_data(member: Member) -> list[dict[str, Any]]:
    """The assumptions of a member."""
    bounds, plant = member.bounds, member.plant
    entries = []
    for name, p in plant.parameters.items():
        interval = bounds.parameters[name]
        entries.append((f"parameter.{name}", interval.low, interval.high, p.unit, p.source))
    for name, interval in bounds.disturbances.items():
        entries.append((f"disturbance.{name}", interval.low, interval.high, plant.load_unit, "study"))
    for name, (value, rate) in bounds.feedforward.items():
        entries.append((f"feedforward.{name}", value.low, value.high, plant.load_unit, "study"))
        entries.append((f"feedforward_rate.{name}", rate.low, rate.high, f"{plant.load_unit}/s", "study"))
    for kind, values in (("noise", bounds.noise), ("initial", bounds.initial)):
        for state, unit, value in zip(plant.states, plant.state_units, values, strict=True):
            entries.append((f"{kind}.{state}", -value, value, unit, "study"))
    keys = ("name", "lower", "upper", "unit", "source")
    return [dict(zip(keys, entry, strict=True)) for entry in entries]


def certificate_data(contract: Contract) -> dict[str, Any]:
    """The certificate of a member, with what it guarantees where it is linked."""
    found = contract.certificate
    data: dict[str, Any] = {
        "kind": "impulse",
        "half_widths": [short(v, up=True) for v in found.half_widths],
        "input_bound": [short(v, up=True) for v in found.input_bound],
        "networks": [
            {"row": state, "low": short(low), "high": short(high), "middle": short(middle),
             "bound": short(bound, up=True)}
            for state, low, high, middle, bound in zip(
                found.networks, found.box.low, found.box.high, found.box.middle, found.box.network_bound, strict=True
            )
        ],
        "split": list(found.partition.split),
        "cells": [
            {"columns": _matrix(cell.columns, FINER), "blocks": list(cell.blocks), "groups": list(cell.groups),
             "growth": short(cell.growth), **(_middle(cell) if found.partition.parts else {})}
            for cell in found.cells
        ],
        "envelope": {
            "rate": short(_rate(contract)), "ultimate": [short(v * (1 + ULTIMATE), up=True) for v in found.ultimate]
        },
    }  # fmt: skip
    # where other constants than inertias are cut, each cell has a middle of its own
    data |= {"parts": dict(found.partition.parts)} if found.partition.parts else _middle(found.cells[0])
    data |= {"lags": list(found.lags)} if found.lags else {}
    if found.box.shown.size:
        data["observed"] = [short(v, up=True) for v in found.box.shown]
    if contract.guarantee is not None:
        data["guarantee"] = _tube(contract.guarantee)
    return data


def _middle(cell: Cell) -> dict[str, Any]:
    return {"force": _matrix(cell.force), "drive": _matrix(cell.drive)}


def _rate(contract: Contract) -> float:
    """The rate at which what a start makes shrinks, 1/s, from below: ln g >= 2 (g - 1)/(g + 1)."""
    least = min(cell.growth for cell in contract.certificate.cells)
    return RATE * 2 * (least - 1) / (least + 1) / contract.bounds.period


def _matrix(rows: np.ndarray, digits: int = DIGITS) -> list[list[str]]:
    return [[short(v, digits=digits) for v in row] for row in rows]


def _tube(tube: Tube) -> list[str]:
    return [short(ROOM * v, up=True) for v in (tube.position, tube.speed, tube.acceleration)]


def observer_data(member: Member) -> dict[str, Any]:
    """The observer of a member, where it has one."""
    observer = member.bounds.observer
    return {} if observer is None else {"observer": {"first": observer.first, "second": observer.second}}


def coupling_data(problem: Problem, contracts: Contracts) -> list[dict[str, Any]]:
    """What the members do to each other, the output, and the bound on its error."""
    if problem.loads is None:
        return []
    return [{
        "members": list(problem.machine.members),
        "loads": problem.machine.expression.to_data(),
        "place": problem.machine.place_expression.to_data(),
        "halvings": HALVINGS,
        "envelope": {"output": stated_output(problem, contracts)},
    }]  # fmt: skip


def stated_output(problem: Problem, contracts: Contracts) -> str:
    """The bound on the output's error that the file of a machine states."""
    ultimates = np.array([contracts[m.name].certificate.ultimate[0] * (1 + ULTIMATE) for m in problem.members])
    return short(output_bound(problem, ultimates) * (1 + OUTPUT) + 1e-12, up=True)


def short(value: float, *, up: bool = False, digits: int = DIGITS) -> str:
    """A short rational near a float as it is printed, as "p/q" text; not below it where `up`."""
    context = Context(prec=digits, rounding=ROUND_CEILING if up else ROUND_HALF_EVEN)
    return str(Fraction(context.create_decimal(Decimal(repr(float(value))))))
