"""A machine as its gain file has it: what is simulated again, and what stands when one actuator is exchanged."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import replace
from fractions import Fraction
from typing import Any

from stability import Bounds, Gains, Interval
from stability.coupling import Tube
from stability.network import Contract, prove

from .axis import Axis
from .errors import InvalidInputError
from .gain_file import gains_of, reference_of
from .machine_file import observer_data, resolved_machine
from .machine_problem import MachineProblem, assemble_machine
from .machine_study import MachineStudy
from .study import parse_data


def machine_of(document: Mapping[str, Any]) -> tuple[MachineProblem, dict[str, tuple[Gains, ...]]]:
    """The problem and the gains of a machine's file, proved or rejected.

    Raises:
        InvalidInputError: the study of the file is not that of a machine.
    """
    study = study_of_machine(document["study"])
    if "joints" not in document:
        return assemble_machine(study), _rejected_gains(document, study)
    references = tuple(reference_of(document["joints"][name]) for name in study.joints)
    problem = assemble_machine(study, references)
    _same_machine(document, problem)
    return problem, {name: gains_of(document["joints"][name]) for name in study.joints}


def _same_machine(document: Mapping[str, Any], problem: MachineProblem) -> None:
    """Refuse a file whose machine is not the one that this release makes of its study.

    The checker takes loads, tool and plants as given; here they are compared with the symbolic ones.
    """
    certificate = document["certificate"]
    made = {
        "study": resolved_machine(problem), "loads": problem.machine.expression.to_data(),
        "tool": problem.machine.tool_expression.to_data(),
    }  # fmt: skip
    given = {"study": {k: v for k, v in document["study"].items() if k != "sha256"},
             "loads": certificate["loads"], "tool": certificate["tool"]}  # fmt: skip
    if problem.observer is not None:
        made["observer"], given["observer"] = observer_data(problem), document["controller"]["observer"]
    for name, axis in zip(problem.machine.joints, problem.axes, strict=True):
        made[name] = axis.model.to_data()
        given[name] = document["joints"][name]["certificate"]["model"]
    for part, value in made.items():
        if json.loads(json.dumps(value)) != given[part]:
            raise InvalidInputError(
                f"the {part} of this file is not what this release makes of its study; write it again with design"
            )


def study_of_machine(data: Mapping[str, Any]) -> MachineStudy:
    """The study that a resolved one came from.

    Raises:
        InvalidInputError: the section is not that of a machine's study.
    """
    plain = json.loads(json.dumps(data))
    for key in ("sha256", "ranges", "assumed"):
        plain.pop(key, None)
    plain["plant"].pop("axes", None)
    found = parse_data(plain, "study")
    if not isinstance(found, MachineStudy):
        raise InvalidInputError("study: not that of a machine; give a file that design wrote for one")
    return found


def _rejected_gains(document: Mapping[str, Any], study: MachineStudy) -> dict[str, tuple[Gains, ...]]:
    found = {}
    for name in study.joints:
        own = [
            {**entry, "name": entry["name"].removeprefix(f"{name}.")}
            for entry in document["gains"] if entry["name"].startswith(f"{name}.")
        ]  # fmt: skip
        found[name] = gains_of({"gains": own})
    return found


def standing(
    document: Mapping[str, Any], study: MachineStudy, joint: str
) -> tuple[MachineProblem, dict[str, tuple[Gains, ...]], dict[str, Contract], Axis]:
    """A machine with one other actuator: its problem, the standing gains and contracts, and the axis that is replaced.

    Args:
        document: The proved file of the machine.
        study: The same study but for one joint.
        joint: That joint.

    Raises:
        InvalidInputError: there is no such joint, or the study differs in more than that joint.
    """
    before = study_of_machine(document["study"])
    if joint not in study.joints or study.joints != before.joints:
        raise InvalidInputError(
            f"--exchange names one of the joints {', '.join(before.joints)}: got {joint}; correct it"
        )
    references = tuple(reference_of(document["joints"][name]) for name in study.joints)
    problem = assemble_machine(study, references)
    old, _ = machine_of(document)
    for name, new, was in zip(study.joints, problem.machine.plants, old.machine.plants, strict=True):
        if name != joint and (new.parameters != was.parameters or new.limits != was.limits):
            raise InvalidInputError(f"the studies differ in {name} too; design the machine anew")
    gains = {name: gains_of(document["joints"][name]) for name in study.joints}
    promises = {
        name: Tube(position=p[0], speed=p[1], acceleration=p[2])
        for name, entry in document["certificate"]["promises"].items()
        for p in [[float(Fraction(v)) for v in entry]]
    }
    contracts: dict[str, Contract] = {}
    for k, name in enumerate(study.joints):
        bounds = stated_bounds(old.axes[k].bounds, document["joints"][name])
        if name == joint:
            found = prove(name, old.subsystems(gains)[name], bounds)
        else:
            found = prove(name, problem.subsystems(gains)[name], bounds)
        assert isinstance(found, Contract)
        contracts[name] = replace(found, promise=promises[name])
    return problem, gains, contracts, old.axes[study.joints.index(joint)]


def stated_bounds(bounds: Bounds, document: Mapping[str, Any]) -> Bounds:
    """The assumptions of a joint's file in place of those of a joint without neighbours."""
    ranges = {
        entry["name"]: Interval(float(entry["lower"]), float(entry["upper"])) for entry in document["assumptions"]
    }
    states = [row["state"] for row in document["controller"]["subsystems"]]
    return replace(
        bounds,
        disturbances={key: ranges[f"disturbance.{key}"] for key in bounds.disturbances},
        noise=tuple(ranges[f"noise.{state}"].high for state in states),
    )
