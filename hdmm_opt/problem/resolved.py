"""A study with every default filled in, in the schema of a study: it can be read again."""

from __future__ import annotations

from typing import Any

from ..plants import EFFECTIVENESS, Plant
from .problem import Problem


def resolved(problem: Problem) -> dict[str, Any]:
    """The study as JSON data: numbers of every member, gains of every member, states by name."""
    study = problem.study
    data = study.model_dump(mode="json", exclude_none=True)
    plant = data["plant"]
    plant["parameters"] = {}
    plant.pop("damping", None)  # it is a parameter of every joint
    several = {member.name: member for member in problem.members}
    plant["joints"] = {name: _numbers(member.plant, problem) for name, member in several.items()}
    controller = data["controller"]
    controller["gains"] = {}
    controller["members"] = {
        name: {g.name: {"value": g.low} if g.fixed else {"min": g.low, "max": g.high} for g in member.ranges}
        for name, member in several.items()
    }
    uncertainty = data["uncertainty"]
    for kind in ("noise", "initial"):
        uncertainty[kind] = {
            state: value
            for member in problem.members
            for state, value in zip(member.plant.states, getattr(member.bounds, kind), strict=True)
        }
    for disturbance in problem.machine.disturbances:
        uncertainty["disturbances"][disturbance.name]["course"] = disturbance.course
    return data


def _numbers(plant: Plant, problem: Problem) -> dict[str, Any]:
    """Parameters, limits, stroke and effectiveness of a plant, as a study gives them.

    What a coupling makes the plant carry follows from the reference, and is not a number of the study.
    """
    left_out = {EFFECTIVENESS, *([plant.carried] if problem.loads is not None else [])}
    data: dict[str, Any] = {
        "parameters": {
            name: {"value": p.value, "unit": p.unit, "tolerance": p.tolerance, "source": p.source, "meaning": p.meaning}
            for name, p in plant.parameters.items() if name not in left_out
        },
        "limits": {
            limit.name: {"value": limit.value, "unit": limit.unit, "source": limit.source} for limit in plant.limits
        },
        "stroke": list(plant.stroke),
    }  # fmt: skip
    if EFFECTIVENESS in plant.parameters:
        ends = plant.parameters[EFFECTIVENESS].ends
        data["least_effectiveness"] = ends[0] if ends else 1.0
    return data
