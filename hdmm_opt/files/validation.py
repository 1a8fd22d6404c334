"""The `validation` section of a gain file: what simulations showed beside what is proved."""

from __future__ import annotations

import json
from fractions import Fraction
from typing import Any

from ..problem import Problem
from ..simulation import Figures, Scenario
from ..simulation.figures import plain
from ..simulation.requirements import figure_of, reached, required
from .read import certified_of, ultimate_of
from .result import Validation, Witness


def to_data(problem: Problem, shown: Validation) -> dict[str, Any]:
    """The section of a design; what is certified of the requirements is left to the checker, see `seal.py`."""
    members = {}
    for member in problem.members:
        own = [m.members[member.name] for m in shown.inside]
        estimates = [m.estimates for m in own if m.estimates]
        members[member.name] = {
            "largest_error": max((m.largest_error for m in own), default=0.0),
            "largest_error_after_transient": max((m.maximum_error for m in own), default=0.0),
            "unit": member.plant.state_units[0],
            **({"estimates": [max(column) for column in zip(*estimates, strict=True)]} if estimates else {}),
        }
    return plain({
        "requirements": requirements(problem, shown),
        "scenarios": [{"name": s.name, "figures": m.to_data()} for s, m in shown.runs],
        "worst_case": _worst(*shown.worst) if shown.worst else None,
        "monte_carlo": shown.monte_carlo,
        "simulated_runs": len(shown.inside),
        "integration_error_m": shown.integration_error,
        "largest_error_m": shown.largest_error,
        "largest_error_after_transient_m": shown.largest_late_error,
        "members": members,
    })  # fmt: skip


def _worst(scenario: Scenario, figures: Figures) -> dict[str, Any]:
    return {"scenario": scenario.to_data(), "figures": figures.to_data()}


def requirements(problem: Problem, shown: Validation) -> list[dict[str, Any]]:
    """Each requirement: required, and simulated."""
    return [
        {"name": name, "required": limit, "simulated": reached(problem, name, shown.inside), "certified": None}
        for name, limit in required(problem).items()
    ]


def contradiction(problem: Problem, document: dict[str, Any], witness: Witness) -> str | None:
    """What a run did that the certificates of a gain file exclude, as text; None where nothing."""
    if not witness.largest_use < 1 - 1e-9:
        return f"a run used {witness.largest_use:.6g} of a limit that is proved"
    scenario = json.dumps(witness.scenario.to_data())
    for entry in document["members"]:
        radius, reached = float(Fraction(entry["certificate"]["half_widths"][0])), witness.largest_errors[entry["name"]]
        late = witness.figures.members[entry["name"]].maximum_error
        if not (reached <= radius and late <= ultimate_of(entry)):
            return f"a run reached {reached:.6g} in {entry['name']}, certified {radius:.6g}, in scenario {scenario}"
    late, bound = witness.figures.maximum_error_m, certified_of(document)
    if not late <= bound:
        return f"a run reached {late:.6g} m, certified {bound:.6g} m, in scenario {scenario}"
    for row in document["validation"]["requirements"]:
        seen, told = figure_of(problem, row["name"], witness.figures), row["certified"]
        if told is not None and not seen <= told:
            return f"a run reached {row['name']} = {seen:.6g}, certified {told:.6g}, in scenario {scenario}"
    return None


def stored(problem: Problem, document: dict[str, Any], witness: Witness) -> dict[str, Any]:
    """A gain file's document with the witness as its worst case, where it is worse than the one there."""
    shown = dict(document["validation"])
    shown["requirements"] = [
        {**row, "simulated": max(row["simulated"] or 0.0, figure_of(problem, row["name"], witness.figures))}
        for row in shown["requirements"]
    ]
    late = witness.figures.maximum_error_m
    shown["simulated_runs"] = shown.get("simulated_runs", 0) + witness.runs
    shown["largest_error_m"] = max(shown["largest_error_m"], witness.largest_error)
    shown["members"] = {
        name: {**entry, "largest_error": max(entry["largest_error"], witness.largest_errors[name])}
        for name, entry in shown["members"].items()
    }
    if late >= shown["largest_error_after_transient_m"]:
        shown["worst_case"] = _worst(witness.scenario, witness.figures)
        shown["largest_error_after_transient_m"] = late
    return {**document, "validation": plain(shown)}
