"""How a machine is made from the `[plant]` section of a study."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from typing import Any

from ..errors import RefusedKeyError
from ..names import nearest
from ..plants import EFFECTIVENESS, Limit, Parameter, Plant, effectiveness
from .machine import Machine


@dataclass(frozen=True, kw_only=True)
class Model:
    """What `study` and `problem` ask of a machine.

    Attributes:
        members: Section -> names of the members.
        check: Refuses a section that does not fit, with `RefusedKeyError`.
        build: Section -> the machine.
        kinds: Kinds of reference that it can follow.
    """

    members: Callable[[Any], tuple[str, ...]]
    check: Callable[[Any], None]
    build: Callable[[Any], Machine]
    kinds: tuple[str, ...]


def given(parameters: Mapping[str, Any], known: Mapping[str, Parameter]) -> dict[str, Parameter]:
    """Parameters of a study over the known ones, whose tolerance and meaning they take where they give none."""
    return {
        name: replace(
            known[name], value=p.value, unit=p.unit, source=p.source,
            tolerance=known[name].tolerance if p.tolerance is None else p.tolerance,
        )
        for name, p in parameters.items()
    }  # fmt: skip


def numbers_of(plant: Plant, section: Any, least: float | None) -> Plant:
    """A plant with the limits, the stroke and the effectiveness that a study gives."""
    limits = {
        limit.name: replace(limit, value=section.limits[limit.name].value, source=section.limits[limit.name].source)
        for limit in plant.limits if section is not None and limit.name in section.limits
    }  # fmt: skip
    parameters = {} if least is None else {EFFECTIVENESS: effectiveness(least)}
    stroke = None if section is None else section.stroke
    return plant.with_values(parameters=parameters, limits=limits, stroke=stroke)


def check_parameters(where: str, parameters: Mapping[str, Any], known: Mapping[str, Parameter], what: str) -> None:
    """Refuse parameters that a plant does not have, in other units, or of the wrong sign."""
    for name, p in parameters.items():
        if name not in known or name == EFFECTIVENESS:
            raise RefusedKeyError(f"{where}.{name}", f"is not a parameter of {what}", nearest(name, known))
        if p.unit != known[name].unit:
            rule = f'must be "{known[name].unit}": got "{p.unit}"'
            raise RefusedKeyError(f"{where}.{name}.unit", rule, "convert the value")
        if known[name].value > 0 and not p.value > 0:
            raise RefusedKeyError(f"{where}.{name}.value", f"must be positive: got {p.value:g}", "correct the sign")


def check_numbers(where: str, section: Any, limits: tuple[Limit, ...]) -> None:
    """Refuse limits that a plant does not have or in other units, and a stroke without length."""
    known = {limit.name: limit for limit in limits}
    for name, entry in section.limits.items():
        if name not in known:
            raise RefusedKeyError(f"{where}.limits.{name}", "is not a limit of this plant", nearest(name, known))
        if entry.unit != known[name].unit:
            rule = f'must be "{known[name].unit}": got "{entry.unit}"'
            raise RefusedKeyError(f"{where}.limits.{name}.unit", rule, "convert the value")
    if section.stroke is not None and not section.stroke[0] < section.stroke[1]:
        raise RefusedKeyError(f"{where}.stroke", f"needs lower < upper: got {list(section.stroke)}", "correct them")


def no_place(section: Any, keys: tuple[str, ...], name: str) -> None:
    """Refuse keys that a model does not read."""
    for key in keys:
        value = getattr(section, key)
        if value not in (None, {}, (), ""):
            raise RefusedKeyError(key, f'has no place with model = "{name}"', "remove it")
