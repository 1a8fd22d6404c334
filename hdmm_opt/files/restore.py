"""A machine as its gain file has it: what is simulated again, and what stands when one actuator is replaced."""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import replace
from fractions import Fraction
from typing import Any

from stability import Bounds, Failure, Interval
from stability.networks.contracts import Contract, prove
from stability.networks.coupling import Tube

from ..errors import InvalidInputError
from ..plants.own import own_name, record
from ..problem import GainSet, Member, Problem, assemble
from ..problem.problem import Contracts
from ..problem.resolved import resolved
from ..simulation import Loop, Scenario, scenarios
from ..study import Study, validated
from .read import gains_of, references_of, rejected
from .recorded import recorded_plant
from .sections import model_data, observer_data


def study_of(document: Mapping[str, Any]) -> Study:
    """The study of a gain file or of a rejected one.

    Raises:
        InvalidInputError: the section is not that of a study.
    """
    plain = {key: value for key, value in document["study"].items() if key != "sha256"}
    return validated(json.loads(json.dumps(plain)), "study")


def restored(document: Mapping[str, Any]) -> tuple[Problem, GainSet]:
    """The problem and the gains of a gain file, proved or rejected.

    Raises:
        InvalidInputError: the machine of the file is not what this release makes of its study.
    """
    with whole():
        name = document["study"]["plant"]["model"]
        if isinstance(name, str) and own_name(name):
            record(name, recorded_plant(document))
        problem = assemble(study_of(document), references_of(document))
        if rejected(document):
            return problem, gains_of(document)
        _same_machine(document, problem)
        return problem, _fitting(document)


def _fitting(document: Mapping[str, Any]) -> GainSet:
    """The gains, which are those of the study's members."""
    found, ranges = gains_of(document), document["study"]["controller"]["members"]
    if {name: len(own) for name, own in found.items()} != {name: len(own) for name, own in ranges.items()}:
        raise InvalidInputError("the gains of this file are not those of its members; write it again with design")
    return found


@contextmanager
def whole() -> Iterator[None]:
    """Turn what a malformed file provokes into one line.

    Raises:
        InvalidInputError: a part of the file is missing or has the wrong type.
    """
    try:
        yield
    except (KeyError, TypeError, AttributeError, IndexError, ValueError, AssertionError) as error:
        if isinstance(error, InvalidInputError):
            raise
        raise InvalidInputError(
            f"a part of this file is missing or malformed: {error!r:.80}; write it again with design"
        ) from None


def offered(document: Mapping[str, Any], problem: Problem) -> dict[str, tuple[Loop, Scenario]]:
    """The scenarios that a file offers by name, each with its loop; a witness may have a control rate of its own."""
    loop = Loop(problem)
    found = {s.name: (loop, s) for s in scenarios(problem)}
    with whole():
        worst = document.get("validation", {}).get("worst_case")
        if worst:
            found["worst-case"] = (loop, Scenario.from_data(worst["scenario"]))
        for entry in document["obligations"]:
            if entry.get("witness"):
                period = 1 / float(entry["witness"]["rate_hz"])
                own = loop if period == problem.period else Loop(problem, period=period)
                found["witness"] = (own, Scenario.from_data(entry["witness"]["scenario"]))
    return found


def _same_machine(document: Mapping[str, Any], problem: Problem) -> None:
    """Refuse a file whose machine is not the one that this release makes of its study.

    The checker takes loads, output and plants as given; here they are compared with the symbolic ones.
    """
    made: dict[str, Any] = {"study": resolved(problem)}
    given: dict[str, Any] = {"study": {k: v for k, v in document["study"].items() if k != "sha256"}}
    if problem.loads is not None:
        made |= {"loads": problem.machine.expression.to_data(), "output": problem.machine.place_expression.to_data()}
        coupling = document["couplings"][0]
        given |= {"loads": coupling["loads"], "output": coupling["place"]}
    foreign = own_name(problem.study.plant.model)
    for member, entry in zip(problem.members, document["members"], strict=True):
        if not foreign:  # else it was made of that model
            made[member.name], given[member.name] = model_data(member, problem.machine.shared), entry["model"]
        made[f"nominal of {member.name}"], given[f"nominal of {member.name}"] = (
            dict(member.bounds.nominal),
            entry["nominal"],
        )
        key = f"observer of {member.name}"
        made[key], given[key] = observer_data(member), {k: v for k, v in entry.items() if k == "observer"}
    for part, value in made.items():
        if json.loads(json.dumps(value)) != given[part]:
            raise InvalidInputError(
                f"the {part} of this file is not what this release makes of its study; write it again with design"
            )


def standing(document: Mapping[str, Any], study: Study, name: str) -> tuple[Problem, GainSet, Contracts, Member]:
    """A machine with one other actuator: its problem, the standing gains and proofs, and the member that is replaced.

    Members that nothing joins guarantee nothing to each other: there are no standing proofs to keep.

    Args:
        document: The proved file of the machine.
        study: The same study but for one member.
        name: That member.

    Raises:
        InvalidInputError: there is no such member, or the study differs in more than that member.
    """
    old, gains = restored(document)
    if name not in study.members or study.members != old.study.members:
        raise InvalidInputError(
            f"--exchange names one of the members {', '.join(old.study.members)}: got {name}; correct it"
        )
    problem = assemble(study, references_of(document))
    for new, was in zip(problem.members, old.members, strict=True):
        same = new.plant.parameters == was.plant.parameters and new.plant.limits == was.plant.limits
        if new.name != name and not same:
            raise InvalidInputError(f"the studies differ in {new.name} too; design the machine anew")
    contracts: Contracts = {}
    for entry in document["members"] if problem.linked else ():
        key = entry["name"]
        plain = old if key == name else problem
        bounds = _stated(old.member(key), entry)
        contracts[key] = _stood(key, plain, gains, bounds, entry)
    return problem, gains, contracts, old.member(name)


def _stood(name: str, problem: Problem, gains: GainSet, bounds: Bounds, entry: Mapping[str, Any]) -> Contract:
    found = prove(name, problem.subsystems(gains)[name], bounds)
    if isinstance(found, Failure) or "guarantee" not in entry["certificate"]:
        raise InvalidInputError(f"{name} guarantees nothing to other members: design the machine anew")
    position, speed, acceleration = (float(Fraction(v)) for v in entry["certificate"]["guarantee"])
    return replace(found, guarantee=Tube(position=position, speed=speed, acceleration=acceleration))


def _stated(member: Member, entry: Mapping[str, Any]) -> Bounds:
    """The assumptions of a member's entry in place of those of a member without neighbours."""
    ranges = {a["name"]: Interval(float(a["lower"]), float(a["upper"])) for a in entry["assumptions"]}
    return replace(
        member.bounds,
        disturbances={key: ranges[f"disturbance.{key}"] for key in member.bounds.disturbances},
    )
