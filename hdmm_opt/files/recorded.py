"""A plant as its gain file holds it: operations in place of the code that made it, which is never run from a file."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from stability.enclosures.expression import Expression, run

from ..machines.model import STROKE
from ..plants import EFFECTIVENESS, Limit, Parameter, Plant, effectiveness
from ..plants.registry import PlantModel
from ..plants.sound import check_plant


def recorded_plant(document: Mapping[str, Any]) -> PlantModel:
    """The plant of a file of one member.

    Args:
        document: A gain file, or what a refused design left.

    Returns:
        The plant with the numbers of the file's study, and of its outputs those that requirements are about.
    """
    (entry,) = document["members"]
    study = document["study"]
    section, model = study["plant"]["joints"][entry["name"]], entry["model"]
    known = {
        name: Parameter(
            value=p["value"], unit=p["unit"], tolerance=p["tolerance"], source=p["source"], meaning=p["meaning"],
            loss=p["value"] == 0,
        )
        for name, p in section["parameters"].items()
    }  # fmt: skip
    if "least_effectiveness" in section:
        known[EFFECTIVENESS] = effectiveness(section["least_effectiveness"])

    def build(level: str, given: Mapping[str, Parameter], ratings: Mapping[str, Parameter]) -> Plant:
        return check_plant(_plant(study, section, model, {**known, **given}))

    levels = (str(study["plant"]["level"]),) if "level" in study["plant"] else ("",)
    return PlantModel(levels=levels, defaults=lambda level: known, build=build)


def _plant(study: Mapping[str, Any], section: Mapping[str, Any], model: Mapping[str, Any], known: Any) -> Plant:
    import casadi as ca

    rows, inputs = model["rows"], tuple(model["inputs"])
    disturbed = study["uncertainty"]["disturbances"]
    limits = tuple(
        Limit(name=limit["name"], signals=tuple(limit["signals"]), **section["limits"][limit["name"]])
        for limit in model["limits"]
    )
    states = tuple(row["state"] for row in rows)
    x, u = ca.SX.sym("x", len(states)), ca.SX.sym("u", len(inputs))
    w, p = ca.SX.sym("w", len(disturbed)), ca.SX.sym("p", len(known))
    symbols = {name: part[k] for part, names in ((x, states), (u, inputs), (w, disturbed), (p, known))
               for k, name in enumerate(names)}  # fmt: skip
    values = ca.vertcat(*_values(model["plant"], symbols))
    n, unit = len(states), rows[0]["unit"]
    units = {entry["unit"] for entry in disturbed.values()}
    return Plant(
        name=study["plant"]["model"], level=study["plant"].get("level", ""), states=states,
        state_units=tuple(row["unit"] for row in rows), inputs=inputs, input_unit=limits[0].unit,
        disturbances=tuple(disturbed), parameters=known, targets=tuple(row["target"] for row in rows),
        controlled=tuple(row["controlled"] for row in rows), input_map=tuple(model["input_map"]), x=x, u=u, w=w, p=p,
        mass=values[:n], force=values[n:], limits=limits, stroke=tuple(section[STROKE[unit]]),
        outputs={name: _values(entry["program"], symbols)[0] for name, entry in model["outputs"].items()},
        output_units={name: entry["unit"] for name, entry in model["outputs"].items()},
        load_unit=next(iter(units)), first=model["first"], leads=model.get("leads", 0),
    )  # fmt: skip


def _values(program: Mapping[str, Any], symbols: Mapping[str, Any]) -> list[Any]:
    """Outputs of an operation list as CasADi expressions."""
    import casadi as ca

    operators = {
        "add": lambda a, b: a + b, "sub": lambda a, b: a - b, "mul": lambda a, b: a * b, "div": lambda a, b: a / b,
        "neg": lambda a: -a, "sq": lambda a: a * a, "sqrt": ca.sqrt, "tanh": ca.tanh, "sin": ca.sin, "cos": ca.cos,
        "max": ca.fmax,
    }  # fmt: skip
    expression = Expression(
        inputs=tuple(program["inputs"]), operations=tuple(map(tuple, program["operations"])),
        outputs=tuple(program["outputs"]),
    )  # fmt: skip
    table = run(expression, symbols.__getitem__, operators, ca.SX)
    return [table[index] for index in expression.outputs]
