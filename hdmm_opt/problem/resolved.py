"""A study with every default filled in, in the schema of a study: it can be read again."""

from __future__ import annotations

from typing import Any

import numpy as np

from ..machines.model import STROKE
from ..plants import EFFECTIVENESS, Parameter, Plant
from .build import by_state
from .problem import Problem


def resolved(problem: Problem) -> dict[str, Any]:
    """The study as JSON data: numbers of every member, gains of every member, states by name."""
    study = problem.study
    data = study.model_dump(mode="json", exclude_none=True)
    plant = data["plant"]
    for key in ("parameters", "ratings", "limits"):
        plant[key] = {}
    for key in STROKE.values():
        plant.pop(key, None)
    plant.pop("damping", None)  # it is a parameter of every joint
    for scenario in data["validation"]["scenarios"]:
        for fault in scenario["faults"].values():
            if fault["kind"] == "actuator":  # which has no size
                del fault["kind"], fault["size"]
    body = problem.machine.body
    plant.pop("body")
    plant.pop("shared")
    if problem.machine.shared:
        plant["shared"] = {
            output: {"value": limit.value, "unit": limit.unit, "source": limit.source}
            for output, limit in problem.machine.shared.items()
        }
    if body is not None:
        plant["body"] = {name: _number(p) for name, p in body.parameters.items()}
    several = {member.name: member for member in problem.members}
    plant["joints"] = {name: _numbers(name, member.plant, problem) for name, member in several.items()}
    data["reference"] |= {"coordinates": "members", "waypoints": _waypoints(problem)}
    controller = data["controller"]
    controller["gains"] = {}
    if not controller["jitter_s"]:
        del controller["jitter_s"]
    controller["members"] = {
        name: {g.name: {"value": g.low} if g.fixed else {"min": g.low, "max": g.high} for g in member.ranges}
        for name, member in several.items()
    }
    uncertainty = data["uncertainty"]
    for kind in ("noise", "resolution", "initial"):
        uncertainty[kind] = {
            state: value
            for k, member in enumerate(problem.members)
            for state, value in zip(
                member.plant.states, by_state(getattr(problem.study.uncertainty, kind), problem.machine, k), strict=True
            )
        }
    if not any(uncertainty["resolution"].values()):
        del uncertainty["resolution"]
    for disturbance in problem.machine.disturbances:
        uncertainty["disturbances"][disturbance.kind] |= {"course": disturbance.course, "unit": disturbance.unit}
    return data


def _waypoints(problem: Problem) -> list[list[float]]:
    """The waypoints in coordinates of the members: where their references rest."""
    section = problem.study.reference
    if section.coordinates == "members" or problem.machine.of_joints is None:
        return [list(place) for place in section.waypoints]
    return [[float(v) for v in np.array(problem.machine.of_joints(place)).ravel()] for place in section.waypoints]


def _number(p: Parameter) -> dict[str, Any]:
    return {"value": p.value, "unit": p.unit, "tolerance": p.tolerance, "source": p.source, "meaning": p.meaning}


def _numbers(name: str, plant: Plant, problem: Problem) -> dict[str, Any]:
    """Parameters, limits, stroke and effectiveness of a plant, as a study gives them.

    What a coupling makes the plant carry follows from the reference, and is not a number of the study.
    """
    left_out = {EFFECTIVENESS, *([plant.carried] if problem.loads is not None else [])}
    data: dict[str, Any] = {
        "parameters": {
            name: _number(p)
            for name, p in plant.parameters.items() if name not in left_out
        },
        "limits": {
            limit.name: {"value": limit.value, "unit": limit.unit, "source": limit.source} for limit in plant.limits
        },
        STROKE[plant.state_units[0]]: list(plant.stroke),
    }  # fmt: skip
    if plant.ratings:
        data["ratings"] = {
            name: {"value": p.value, "unit": p.unit, "source": p.source} for name, p in plant.ratings.items()
        }
    if problem.machine.bundled.get(name):
        data["bundled"] = list(problem.machine.bundled[name])
    if EFFECTIVENESS in plant.parameters:
        ends = plant.parameters[EFFECTIVENESS].ends
        data["least_effectiveness"] = ends[0] if ends else 1.0
    return data
