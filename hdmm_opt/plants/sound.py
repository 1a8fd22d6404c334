"""Whether a plant is one: what is refused before a law is made for it."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

from stability.checker import MAX_LEADS, NAME, UNIT_TEXT
from stability.enclosures.expression import Expression
from stability.loops.model import BALANCE, CONSTANT, SIGNALS

from ..errors import InvalidInputError
from .parameter import SOURCES, Parameter
from .plant import Plant

#: Operations that the prover and the checker bound in a plant, as users know them.
BOUNDED = ("add", "sub", "mul", "div", "neg", "sq", "sqrt", "tanh", "max", "input", "const")
#: Units of a first state.
FIRST = {"position": ("m", "rad"), "speed": ("m/s", "rad/s")}


def check_plant(plant: Any) -> Plant:
    """The plant, where it is in strict-feedback form and its parts fit each other.

    Raises:
        InvalidInputError: one line with the first thing that does not fit.
    """
    if not isinstance(plant, Plant):
        raise _wrong(f"build() must return a Plant: got {type(plant).__name__}", "return one")
    n, m = len(plant.states), len(plant.inputs)
    for what, count, wanted in (
        ("state_units", len(plant.state_units), n), ("targets", len(plant.targets), n),
        ("controlled", len(plant.controlled), n), ("input_map", len(plant.input_map), m),
        ("x", plant.x.numel(), n), ("u", plant.u.numel(), m), ("w", plant.w.numel(), len(plant.disturbances)),
        ("p", plant.p.numel(), len(plant.parameters)), ("mass", plant.mass.numel(), n),
        ("force", plant.force.numel(), n),
    ):  # fmt: skip
        if count != wanted:
            raise _wrong(f"{what} must have {wanted} entries: got {count}", "complete it")
    names = [*plant.states, *plant.inputs, *plant.disturbances, *plant.parameters]
    for name in names:
        if NAME.fullmatch(name) is None or names.count(name) > 1:
            raise _wrong(f"names must be different plain identifiers: got {name!r:.40}", "rename it")
        if name in (*SIGNALS, "r3", CONSTANT):
            raise _wrong(f"{', '.join(SIGNALS)}, r3 and {CONSTANT} are signals of a target: got {name!r}", "rename it")
    if plant.state_units[0] not in FIRST[plant.first]:
        wanted = " or ".join(FIRST[plant.first])
        raise _wrong(f"a first {plant.first} must be in {wanted}: got {plant.state_units[0]!r:.20}", "convert it")
    _check_rows(plant)
    _check_symbols(plant)
    _check_limits(plant)
    _check_operations(plant)
    check_parameters(plant.parameters)
    return plant


def check_parameters(parameters: Any) -> dict[str, Parameter]:
    """Parameters by name, each with a finite value, a unit, a tolerance below one and a source.

    Raises:
        InvalidInputError: the first that is not so.
    """
    if not isinstance(parameters, dict):
        raise _wrong(f"parameters are a dict by name: got {type(parameters).__name__}", "return one")
    for name, p in parameters.items():
        if not isinstance(p, Parameter):
            raise _wrong(f"{name} must be a Parameter: got {type(p).__name__}", "make it one")
        if not math.isfinite(p.value) or not 0 <= p.tolerance < 1:
            rule = f"{name} needs a finite value and a tolerance from 0 to below 1: got {p.value:g}, {p.tolerance:g}"
            raise _wrong(rule, "correct it")
        _check_tags(name, p.unit, p.source)
    return parameters


def _check_tags(name: str, unit: str, source: str) -> None:
    if not isinstance(unit, str) or UNIT_TEXT.fullmatch(unit) is None:
        raise _wrong(f'{name} needs a unit such as "kg m^2", "N m s/rad" or "1": got {unit!r:.20}', "correct it")
    if source not in SOURCES:
        raise _wrong(f"{name} needs a source, one of {', '.join(SOURCES)}: got {source!r:.20}", "choose one")


def _check_limits(plant: Plant) -> None:
    if not plant.limits or set(plant.limits[0].signals) != set(plant.inputs):
        raise _wrong("the first limit must be the amplitude limit of all inputs", "put it first")
    units = dict(zip(plant.states, plant.state_units, strict=True)) | dict.fromkeys(plant.inputs, plant.input_unit)
    for limit in plant.limits:
        if not set(limit.signals) <= set(units) or not limit.value > 0:
            raise _wrong(f"limit {limit.name} must be above 0 and about states or inputs", "correct it")
        _check_tags(f"limit {limit.name}", limit.unit, limit.source)
        for signal in limit.signals:
            if limit.unit != units[signal]:
                rule = f"limit {limit.name} must be in the unit of {signal}, {units[signal]}: got {limit.unit}"
                raise _wrong(rule, "convert it")
    for state, unit, target in zip(plant.states, plant.state_units, plant.targets, strict=True):
        if target in plant.input_map and unit != plant.input_unit:
            raise _wrong(f"{state} carries out the input and must be in {plant.input_unit}: got {unit}", "convert it")


def program_of(plant: Plant, value: Any) -> tuple[Expression | None, list[str]]:
    """A value of a plant as operations over its names, None where that cannot be; and what of them nobody bounds."""
    import casadi as ca

    from stability.enclosures.translation import straight_line

    inputs = ca.vertcat(plant.x, plant.u, plant.w, plant.p)
    names = (*plant.states, *plant.inputs, *plant.disturbances, *plant.parameters)
    try:
        program = straight_line(ca.Function("plant", [inputs], [ca.densify(ca.SX(value))]), names)
    except NotImplementedError:
        return None, ["an operation"]
    return program, sorted({operator for operator, *_ in program.operations} - set(BOUNDED))


def _check_operations(plant: Plant) -> None:
    """Nothing that the prover cannot bound, everything stated is read, and every input moves something."""
    import casadi as ca

    program, other = program_of(plant, ca.vertcat(plant.mass, plant.force))
    if program is None or other:
        raise _wrong(
            f"the prover bounds + - * / squares, square roots, tanh and max: got {other[0]}", "rewrite it with those"
        )
    unread = [name for name in (*plant.disturbances, *plant.parameters) if name not in program.inputs]
    if unread:
        raise _wrong(f"the equations do not use {unread[0]}", "remove it, or put it into ratings")
    for name, symbol in zip(plant.inputs, ca.vertsplit(plant.u) if plant.inputs else [], strict=True):
        if not ca.depends_on(plant.force, symbol):
            raise _wrong(f"input {name} moves nothing", "put it into force")
    masses = ca.Function("mass", [plant.p], [plant.mass])(list(plant.values().values()))
    for state, mass in zip(plant.states, ca.vertsplit(ca.densify(masses)), strict=True):
        if not float(mass) > 0:
            raise _wrong(f"the mass of row {state} must be positive: got {float(mass):g}", "correct it")


def _check_rows(plant: Plant) -> None:
    if plant.targets[0] != "reference" or not plant.controlled[0]:
        raise _wrong("the first row must track the reference under the law", 'start targets with "reference"')
    for i, target in enumerate(plant.targets):
        if isinstance(target, Mapping):
            quotients = [f"{load}/{name}" for load in plant.disturbances for name in plant.parameters]
            known = (*SIGNALS, CONSTANT, *plant.disturbances, *quotients)
            other = next((name for name in target if name not in known), "" if plant.controlled[i] else None)
            if other is not None:
                parts = "r0, r1, r2, constant, disturbances"
                rule = f"target {i + 1} is of a row without law, and made of {parts}: got {other!r:.40}"
                raise _wrong(rule, "correct it")
        elif target == BALANCE:
            reading = plant.readers(i)
            if plant.controlled[i] or len(reading) != 1 or plant.targets[reading[0]] != "reference":
                rule = (
                    f'target {i + 1}, "balance", is of a row without law whose state one other row reads, which tracks'
                )
                raise _wrong(f"{rule} the reference: {len(reading)} read it", "correct it")
        elif target not in ("reference", "zero") and not (
            isinstance(target, int) and 0 <= target < i and plant.controlled[target]
        ):
            rule = f'target {i + 1} must be "reference", "zero", "balance" or a controlled row before it'
            raise _wrong(f"{rule}: got {target!r:.20}", "correct it")
    for row in plant.input_map:
        if not (0 <= row < len(plant.states) and plant.controlled[row]):
            raise _wrong(f"input_map names controlled rows: got {row}", "correct it")
    if not (isinstance(plant.leads, int) and 0 <= plant.leads <= MAX_LEADS):
        raise _wrong(f"leads is a number of sections, 0 to {MAX_LEADS}: got {plant.leads!r:.20}", "correct it")
    if plant.leads and any(plant.controlled[i] and t in plant.input_map for i, t in enumerate(plant.targets)):
        raise _wrong("a row with leads is tracked by no row under the law", "set leads to 0")
    driven = {target for target in plant.targets if isinstance(target, int)} | set(plant.input_map)
    for i, controlled in enumerate(plant.controlled):
        if controlled and i not in driven:
            raise _wrong(f"nothing follows row {i + 1}, which the law acts in", "name it in targets or in input_map")


def _check_symbols(plant: Plant) -> None:
    import casadi as ca

    known = ca.vertcat(plant.x, plant.u, plant.w, plant.p)
    parts = {"mass": plant.mass, "force": plant.force, **{f"output {k}": v for k, v in plant.outputs.items()}}
    for what, part in parts.items():
        other = [str(s) for s in ca.symvar(part) if not any(ca.is_equal(s, k) for k in ca.vertsplit(known))]
        if other:
            raise _wrong(f"{what} reads {other[0]!r:.40}, which is none of x, u, w, p", "use those")
    if ca.depends_on(plant.mass, ca.vertcat(plant.x, plant.u, plant.w)):
        raise _wrong("mass may read parameters alone", "put the rest into force")


def _wrong(rule: str, remedy: str) -> InvalidInputError:
    return InvalidInputError(f"plant.model: {rule}; {remedy}")
