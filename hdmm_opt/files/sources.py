"""What the numbers of a machine rest on: what has no source, and what a study leaves to the bundled machine."""

from __future__ import annotations

from collections.abc import Iterable

from ..plants.own import own_name
from ..problem import Member, Problem


def assumed(problem: Problem) -> tuple[str, ...]:
    """Everything that has no public source, by member and name."""
    found, several = list(problem.machine.assumed), len(problem.members) > 1
    for member in problem.members:
        prefix, plant = f"{member.name}." if several else "", member.plant
        numbers = {**plant.parameters, **plant.ratings}
        found += [f"{prefix}{key}" for key, p in numbers.items() if p.source == "assumed"]
        found += [f"{prefix}{limit.name} limit" for limit in plant.limits if limit.source == "assumed"]
    body = problem.machine.body
    found += [f"body.{key}" for key, p in body.parameters.items() if p.source == "assumed"] if body else []
    return tuple(found)


def assumed_text(problem: Problem) -> str:
    """The same in one line, with the members of each in brackets."""
    return _listed(problem, assumed(problem))


def bundled_text(problem: Problem) -> str:
    """What the study leaves to the bundled machine, in one line; empty where nothing."""
    several = len(problem.members) > 1
    left = [f"{member}.{name}" if several else name for member, own in problem.machine.bundled.items() for name in own]
    if not left:
        return ""
    model = problem.study.plant.model
    return f"still {'the defaults of' if own_name(model) else 'of the bundled'} {model}: {_listed(problem, left)}"


def exact_text(problem: Problem) -> str:
    """Measurements and starts that a study takes as exact, in one line; empty where there are none."""
    parts = []
    for kind, what in (("noise", "measured"), ("initial", "at the start")):
        names = {
            state for m in problem.members
            for state, value in zip(m.plant.states, getattr(m.bounds, kind), strict=True)
            if value == 0 and not (kind == "noise" and state in _unmeasured(m))
        }  # fmt: skip
        ordered = [
            state for state in dict.fromkeys(s for m in problem.members for s in m.plant.states) if state in names
        ]
        parts += [f"{', '.join(ordered)} {what}"] if ordered else []
    return f"taken as exact, because the study gives no error: {'; '.join(parts)}" if parts else ""


def _unmeasured(member: Member) -> set[str]:
    """States that the controller does not measure: a speed that it estimates, and what the law does not read."""
    plant, model = member.plant, member.model
    read = {model.rows[i].state for i in model.controlled}.union(*(term.inputs for term in model.law))
    return {*(s for s in plant.states if s not in read), *(plant.states[1:2] if member.bounds.observer else ())}


def _listed(problem: Problem, names: Iterable[str]) -> str:
    members: dict[str, list[str]] = {}
    for name in names:
        member, _, key = name.rpartition(".")
        members.setdefault(key, []).append(member)
    whole = list(problem.machine.members)
    return ", ".join(
        key if own == [""] else f"{key} ({'all' if own == whole else ', '.join(own)})" for key, own in members.items()
    )
