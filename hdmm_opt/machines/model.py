"""How a machine is made from the `[plant]` section of a study."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, replace
from typing import Any

from ..errors import RefusedKeyError
from ..names import nearest
from ..plants import EFFECTIVENESS, Parameter, Plant, effectiveness
from .machine import Machine

#: Limits of the reference of one actuator, which are required, and of an arm, with an entry for each joint.
SINGLE, EACH = ("speed_m_s", "acceleration_m_s2", "jerk_m_s3"), ("speed", "acceleration", "jerk")


@dataclass(frozen=True, kw_only=True)
class Model:
    """What `study` and `problem` ask of a machine.

    Attributes:
        members: Section -> names of the members.
        check: Section -> the keys that do not fit.
        build: Section -> the machine.
        kinds: Kinds of reference that it can follow.
        limited: Limits of the reference that a study can give, by their keys.
    """

    members: Callable[[Any], tuple[str, ...]]
    check: Callable[[Any], Iterator[RefusedKeyError]]
    build: Callable[[Any], Machine]
    kinds: tuple[str, ...]
    limited: tuple[str, ...] = ()


def given(parameters: Mapping[str, Any], known: Mapping[str, Parameter]) -> dict[str, Parameter]:
    """Parameters of a study over the known ones, whose tolerance and meaning they take where they give none."""
    return {
        name: replace(
            known[name], value=p.value, unit=p.unit, source=p.source,
            tolerance=known[name].tolerance if getattr(p, "tolerance", None) is None else p.tolerance,
        )
        for name, p in parameters.items()
    }  # fmt: skip


#: Keys of a stroke by the unit of the first state.
STROKE = {"m": "stroke_m", "rad": "stroke_rad", "m/s": "stroke_m_s", "rad/s": "stroke_rad_s"}


@dataclass(frozen=True)
class Numbers:
    """What a study says of one member: the numbers of all members, and its own over them.

    Attributes:
        parameters, ratings, limits: Entries of the study by name.
        stroke: Range of the first state, or None.
        least: Least effectiveness, or None.
        bundled: What a gain file says was left to the bundled machine, or None.
    """

    parameters: Mapping[str, Any]
    ratings: Mapping[str, Any]
    limits: Mapping[str, Any]
    stroke: tuple[float, float] | None
    least: float | None
    bundled: tuple[str, ...] | None

    @staticmethod
    def of(section: Any, member: str) -> Numbers:
        """The numbers of a member of a `[plant]` section."""
        own = section.joints.get(member)
        parts = (section,) if own is None else (section, own)
        return Numbers(
            *({name: entry for part in parts for name, entry in getattr(part, kind).items()} for kind in KINDS),
            stroke=stroke_of(*parts),
            least=None if own is None else own.least_effectiveness, bundled=None if own is None else own.bundled,
        )  # fmt: skip

    def left(self, plant: Plant, *, coupled: bool) -> tuple[str, ...]:
        """Names of the numbers of a plant that the study leaves to the bundled machine."""
        if self.bundled is not None:
            return self.bundled
        unasked = {EFFECTIVENESS, *([plant.carried] if coupled else [])}
        found = [name for name in plant.parameters if name not in self.parameters and name not in unasked]
        found += [
            f"{name} tolerance"
            for name, entry in self.parameters.items()
            if name in plant.parameters and entry.tolerance is None and plant.parameters[name].tolerance > 0
        ]
        found += [name for name in plant.ratings if name not in self.ratings]
        found += [f"{limit.name} limit" for limit in plant.limits if limit.name not in self.limits]
        return (*found, *(() if self.stroke else ("stroke",)))


def stroke_of(*sections: Any) -> tuple[float, float] | None:
    """The stroke that the last of some sections gives, or None."""
    given = [getattr(section, key) for section in sections for key in STROKE.values()]
    return next((stroke for stroke in reversed(given) if stroke is not None), None)


#: Kinds of numbers that a study gives by name.
KINDS = ("parameters", "ratings", "limits")


def numbers_of(plant: Plant, given: Numbers) -> Plant:
    """A plant with the limits, the stroke and the effectiveness that a study gives."""
    limits = {
        limit.name: replace(limit, value=given.limits[limit.name].value, source=given.limits[limit.name].source)
        for limit in plant.limits if limit.name in given.limits
    }  # fmt: skip
    parameters = {} if given.least is None else {EFFECTIVENESS: effectiveness(given.least)}
    return plant.with_values(parameters=parameters, limits=limits, stroke=given.stroke)


def check_parameters(
    where: str, parameters: Mapping[str, Any], known: Mapping[str, Parameter], what: str,
    plant: Plant | None,
) -> Iterator[RefusedKeyError]:  # fmt: skip
    """Parameters that a plant does not have, in other units, or of the wrong sign.

    Args:
        where: Place of the section.
        parameters: Its entries.
        known: The parameters of the plant.
        what: The plant, for messages.
        plant: The plant with any numbers, for names that belong in another section; None for what is no plant.
    """
    for name, p in parameters.items():
        if name not in known or name == EFFECTIVENESS:
            elsewhere = "" if plant is None else _elsewhere(name, plant)
            if elsewhere not in ("", "parameters"):
                rule = f"is not a parameter of {what}, but one of its {elsewhere}"
                yield RefusedKeyError(f"{where}.{name}", rule, f"write plant.{elsewhere}.{name}")
            else:
                yield RefusedKeyError(f"{where}.{name}", f"is not a parameter of {what}", nearest(name, known))
        elif p.unit != known[name].unit:
            rule = f'must be "{known[name].unit}": got "{p.unit}"'
            yield RefusedKeyError(f"{where}.{name}.unit", rule, f"convert the value: {known[name].meaning}")
        elif known[name].loss and not p.value >= 0:
            yield RefusedKeyError(f"{where}.{name}.value", f"must be 0 or more: got {p.value:g}", "correct the sign")
        elif known[name].value > 0 and not known[name].loss and not p.value > 0:
            yield RefusedKeyError(f"{where}.{name}.value", f"must be positive: got {p.value:g}", "correct the sign")


def check_numbers(where: str, section: Any, plant: Plant, *, stroke: bool = True) -> Iterator[RefusedKeyError]:
    """Limits and ratings that a plant does not have or in other units, and a stroke without length.

    Args:
        where: Place of the section, with a dot behind it; empty for `[plant]` itself.
        section: The section.
        plant: The plant with any numbers.
        stroke: Whether the section may give a stroke.
    """
    for kind, what, known in (
        ("limits", "limit", {limit.name: (limit.unit, f"of {', '.join(limit.signals)}") for limit in plant.limits}),
        ("ratings", "rating", {name: (p.unit, p.meaning) for name, p in plant.ratings.items()}),
    ):
        for name, entry in getattr(section, kind).items():
            if name not in known:
                elsewhere = _elsewhere(name, plant)
                rule = f"is not a {what} of this plant" + (f", but one of its {elsewhere}" if elsewhere else "")
                remedy = f"write plant.{elsewhere}.{name}" if elsewhere else nearest(name, known)
                yield RefusedKeyError(f"{where}{kind}.{name}", rule, remedy)
                continue
            unit, meaning = known[name]
            if entry.unit != unit:
                rule = f'must be "{unit}": got "{entry.unit}"'
                yield RefusedKeyError(f"{where}{kind}.{name}.unit", rule, f"convert the value: {meaning}")
    for unit, key in STROKE.items():
        given = getattr(section, key)
        if given is not None and (not stroke or unit != plant.state_units[0]):
            rule = f"has no place here: the first state of this plant is in {plant.state_units[0]}"
            remedy = f"give {STROKE[plant.state_units[0]]}" + ("" if stroke else " with its joint")
            yield RefusedKeyError(f"{where}{key}", rule, remedy)
        elif given is not None and not given[0] < given[1]:
            yield RefusedKeyError(f"{where}{key}", f"needs lower < upper: got {list(given)}", "correct them")


def _elsewhere(name: str, plant: Plant) -> str:
    """Which kind of number of a plant a name is."""
    known = {
        "parameters": plant.parameters, "ratings": plant.ratings, "limits": [limit.name for limit in plant.limits]
    }  # fmt: skip
    return next((kind for kind in KINDS if name in known[kind]), "")


def no_place(section: Any, keys: tuple[str, ...], name: str) -> Iterator[RefusedKeyError]:
    """Keys that a model does not read."""
    for key in keys:
        value = getattr(section, key)
        if value not in (None, {}, (), ""):
            yield RefusedKeyError(key, f'has no place with model = "{name}"', "remove it")
