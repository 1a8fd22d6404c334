"""The document of a design: one shape for every machine, each fact once."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from stability import checker

from ..problem import GainSet
from ..problem.problem import Contracts
from ..problem.resolved import resolved
from ..simulation import Loop
from .golden import golden_vectors
from .sections import (
    assumptions_data,
    certificate_data,
    coupling_data,
    gains_data,
    model_data,
    observer_data,
    reference_data,
)


def build(
    loop: Loop, gains: GainSet, contracts: Contracts, validation: dict[str, Any], *,
    kept: Mapping[str, dict[str, Any]] | None = None,
) -> dict[str, Any]:  # fmt: skip
    """The document of a design, without its obligations, hashes and provenance; see `seal.py`.

    Args:
        loop: The problem's loop.
        gains: Gains of all members.
        contracts: Their proofs.
        validation: The `validation` section.
        kept: Entries of members that are taken over as they are.
    """
    problem, vectors = loop.problem, golden_vectors(loop, gains)
    members = []
    for plain in problem.members:
        if kept and plain.name in kept:
            members.append(dict(kept[plain.name]))
            continue
        contract = contracts[plain.name]
        member = plain.under(contract.bounds)
        members.append({
            "name": member.name,
            "model": model_data(member, problem.machine.shared),
            "nominal": dict(member.bounds.nominal),
            **observer_data(member),
            "gains": gains_data(member, gains[member.name]),
            "assumptions": assumptions_data(member),
            "reference": reference_data(member.reference, member.plant.reference_units),
            "certificate": certificate_data(contract),
            "golden": vectors[member.name],
        })  # fmt: skip
    return {
        "schema": checker.SCHEMA,
        "study": resolved(problem),
        "members": members,
        "couplings": coupling_data(problem, contracts),
        "obligations": [],
        "validation": validation,
        "provenance": {},
    }
