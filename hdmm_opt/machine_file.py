"""Gain files of machines: the gain file of each joint, and what joins them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np

from stability import Gains, checker
from stability.coupling import Tube
from stability.network import Contract
from stability.observer import sampled_bounds

from .axis import Axis
from .control import gain_columns
from .gain_file import (
    GOLDEN_VECTORS,
    assumptions_data,
    certificate_data,
    controller_data,
    gains_data,
    prove,
    reference_data,
    short,
)
from .machine_loop import MachineLoop
from .machine_problem import HALVINGS, MachineProblem, tool_errors
from .problem import plant_data

#: Promises are written with so much room that rounding them does not break them.
ROOM = 1 + 1e-6


def resolved_machine(problem: MachineProblem) -> dict[str, Any]:
    """The study with every default filled in, as JSON data."""
    study, machine = problem.study, problem.machine
    data = study.model_dump(mode="json", exclude_none=True)
    data["plant"]["axes"] = {name: _plant(problem, k) for k, name in enumerate(machine.joints)}
    data["ranges"] = {name: _ranges(axis) for name, axis in zip(machine.joints, problem.axes, strict=True)}
    data["assumed"] = list(assumed(problem))
    return data


def assumed(problem: MachineProblem) -> tuple[str, ...]:
    """Everything that has no public source, by joint and parameter."""
    found = list(problem.machine.assumed)
    for name, plant in zip(problem.machine.joints, problem.machine.plants, strict=True):
        found += [f"{name}.{key}" for key, p in plant.parameters.items() if p.source == "assumed"]
        found += [f"{name}.{limit.name} limit" for limit in plant.limits if limit.source == "assumed"]
    return tuple(found)


def assumed_text(problem: MachineProblem) -> str:
    """The same in one line, with the joints of each parameter in brackets."""
    joints: dict[str, list[str]] = {}
    for name in assumed(problem):
        joint, _, key = name.rpartition(".")
        joints.setdefault(key, []).append(joint)
    whole = list(problem.machine.joints)
    return ", ".join(
        key if own == [""] else f"{key} ({'all joints' if own == whole else ', '.join(own)})"
        for key, own in joints.items()
    )


def _plant(problem: MachineProblem, k: int) -> dict[str, Any]:
    plant = problem.machine.plants[k]
    return {"model": plant.name, "level": plant.level, **plant_data(plant)}


def _ranges(axis: Axis) -> dict[str, Any]:
    return {
        item.name: {"value": item.low} if item.fixed else {"min": item.low, "max": item.high} for item in axis.ranges
    }


def joint_document(
    problem: MachineProblem, k: int, gains: tuple[Gains, ...], contract: Contract, largest: float,
    golden: list[dict[str, Any]],
) -> dict[str, Any]:  # fmt: skip
    """The gain file of one joint under what its neighbours promise, sealed.

    Args:
        problem: The machine's problem.
        k: Index of the joint.
        gains: Its gains.
        contract: Its proof.
        largest: Largest simulated error of the joint at any time.
        golden: Input and output vectors of its law.
    """
    study, name = problem.study, problem.machine.joints[k]
    axis = replace(problem.axes[k], bounds=contract.bounds)
    bounds, plant = axis.bounds, axis.plant
    draft = {
        "schema": checker.SCHEMA,
        "study": {
            "study": {"name": f"{study.study.name}-{name}"},
            "plant": _plant(problem, k),
            "uncertainty": {
                "disturbances": {key: [v.low, v.high] for key, v in bounds.disturbances.items()},
                "feedforward": {key: [v.low, v.high] for key, (v, _) in bounds.feedforward.items()},
                "feedforward_rate": {key: [v.low, v.high] for key, (_, v) in bounds.feedforward.items()},
                "noise": dict(zip(plant.states, bounds.noise, strict=True)),
                "initial": dict(zip(plant.states, bounds.initial, strict=True)),
            },
            "controller": {
                "rate_hz": study.controller.rate_hz, "modelling": list(axis.law.modelling), "gains": _ranges(axis)
            },
            "requirements": {"tracking_error_m": study.requirements.joint_error[name]},
            "validation": {"transient_s": study.validation.transient_s},
        },
        "controller": controller_data(axis, study.controller.rate_hz),
        "gains": gains_data(axis, gains),
        "reference": reference_data(axis.reference),
        "assumptions": assumptions_data(axis),
        "certificate": certificate_data(axis, contract.certificate),
        "obligations": [],
        "validation": {"largest_error_m": largest},
        "golden": {"vectors": golden},
        "provenance": {},
    }  # fmt: skip
    finished, _ = prove(draft)
    return finished


def build_machine(
    problem: MachineProblem, gains: Mapping[str, tuple[Gains, ...]], contracts: Mapping[str, Contract],
    validation: dict[str, Any], provenance: dict[str, Any], *, kept: Mapping[str, dict[str, Any]] | None = None,
) -> dict[str, Any]:  # fmt: skip
    """The document of a machine, without its obligations; see `gain_file.prove`.

    Args:
        problem: The machine's problem.
        gains: Gains by joint.
        contracts: Proofs by joint.
        validation: The `validation` section, with the joints' largest errors.
        provenance: The `provenance` section.
        kept: Documents of joints that are taken over as they are.
    """
    study, joints = problem.study, problem.machine.joints
    vectors = golden_vectors(problem, gains)
    documents = {}
    for k, name in enumerate(joints):
        if kept and name in kept:
            documents[name] = dict(kept[name])
            continue
        largest = validation["joints"][name]["largest_error"]
        documents[name] = joint_document(problem, k, gains[name], contracts[name], largest, vectors[name])
    balls = np.array([contracts[name].certificate.ball[0] for name in joints])
    return {
        "schema": checker.SCHEMA,
        "study": resolved_machine(problem),
        "controller": {
            "law": study.controller.law, "modelling": list(study.controller.modelling),
            "rate_hz": study.controller.rate_hz, "period_s": problem.period,
            "joints": [{"name": name} for name in joints],
            **({} if problem.observer is None else {"observer": observer_data(problem)}),
        },
        "gains": [
            {**entry, "name": f"{name}.{entry['name']}"} for name in joints for entry in documents[name]["gains"]
        ],
        "reference": {
            "joints": {name: {"segments": documents[name]["reference"]["segments"]} for name in joints}
        },
        "assumptions": [
            {**entry, "name": f"{name}.{entry['name']}"} for name in joints for entry in documents[name]["assumptions"]
        ],
        "certificate": {
            "kind": "network",
            "loads": problem.machine.expression.to_data(),
            "tool": problem.machine.tool_expression.to_data(),
            "halvings": HALVINGS,
            "promises": {name: _promise(contracts[name].promise) for name in joints},
            "envelope": {"tool": short(tool_errors(problem, balls * (1 + 1e-5)) * (1 + 1e-3) + 1e-12, up=True)},
        },
        "joints": documents,
        "obligations": [],
        "validation": validation,
        "golden": {"joints": list(joints)},
        "provenance": provenance,
    }  # fmt: skip


def _promise(tube: Tube) -> list[str]:
    return [short(ROOM * v, up=True) for v in (tube.position, tube.speed, tube.acceleration)]


def observer_data(problem: MachineProblem) -> dict[str, Any]:
    """The observer of every joint."""
    observer = problem.observer
    assert observer is not None
    proof = sampled_bounds(observer, noise=0.0, acceleration=1.0, initial=0.0)
    assert proof is not None
    section = problem.study.controller.observer
    assert section is not None
    return {
        "first": observer.first, "second": observer.second, "largest": observer.largest, "period_s": observer.period,
        "pole": proof.pole, "epsilon": section.epsilon, "sigma": section.sigma,
    }  # fmt: skip


def golden_vectors(problem: MachineProblem, gains: Mapping[str, tuple[Gains, ...]]) -> dict[str, list[dict[str, Any]]]:
    """Inputs and outputs of one control period of every joint's law, at states near the references."""
    loop = MachineLoop(problem)
    shared, n = loop.shared(), len(problem.machine.joints)
    random = np.random.default_rng(0)
    found: dict[str, list[dict[str, Any]]] = {}
    for k, (name, axis) in enumerate(zip(problem.machine.joints, problem.axes, strict=True)):
        step = axis.law.step_function(problem.period)
        nominal, columns = list(axis.plant.values().values()), np.array(gain_columns(gains[name]))
        spread = np.array([0.01 * size for size in axis.box])
        vectors = []
        for tick in np.linspace(0, shared.shape[0] - 1, GOLDEN_VECTORS).astype(int):
            r, load = shared[tick, 4 * k : 4 * k + 4], shared[tick, 4 * n + k] if problem.foreseeing else 0.0
            x = np.zeros(len(axis.plant.states))
            x[:2] = r[:2]
            x = x + spread * random.uniform(-1, 1, x.size)
            theta = np.abs(random.uniform(0, 1e-3, len(axis.law.governed)))
            u, following, _ = step(x, r, theta, columns, nominal, load)
            entry = {
                "x": x,
                "r": r,
                "theta": theta,
                "u": np.array(u).ravel(),
                "theta_next": np.array(following).ravel(),
            }
            if problem.foreseeing:
                entry["load"] = np.array([load])
            vectors.append({key: [float(v) for v in values] for key, values in entry.items()})
        found[name] = vectors
    return found
