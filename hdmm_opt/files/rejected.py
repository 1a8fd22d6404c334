"""What a refused design leaves behind: the study, the gains, what failed, and what simulations showed."""

from __future__ import annotations

import math
from typing import Any

from ..problem.resolved import resolved
from .read import REJECTED
from .result import Design
from .sections import gains_data, model_data, reference_data
from .sources import assumed


def rejected_document(found: Design) -> dict[str, Any]:
    """The document of a refused design."""
    problem = found.problem
    return {
        "schema": REJECTED,
        "study": resolved(problem),
        "members": [
            {"name": m.name, "model": model_data(m, problem.machine.shared),
             "gains": gains_data(m, found.gains[m.name]),
             "reference": reference_data(m.reference, m.plant.reference_units)}
            for m in problem.members
        ],
        "obligations": [
            {"name": v.name, "member": v.member, "statement": v.statement,
             "margin": v.margin if math.isfinite(v.margin) else None, "unit": v.unit, "verdict": v.verdict,
             "remedy": v.remedy, "witness": v.witness}
            for v in found.verdicts
        ],
        "missed": list(found.missed),
        "simulated": {s.name: m.to_data() for s, m in found.shown.runs} if found.shown else {},
        "assumed": list(assumed(problem)),
    }  # fmt: skip
