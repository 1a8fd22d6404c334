"""What a refused design leaves behind: the study, the gains, what failed, and what simulations showed."""

from __future__ import annotations

import math
from typing import Any

from .read import REJECTED
from .result import Design
from .sections import assumed


def rejected_document(found: Design) -> dict[str, Any]:
    """The document of a refused design."""
    problem = found.problem
    return {
        "schema": REJECTED,
        "study": problem.study.model_dump(mode="json", exclude_none=True),
        "members": [
            {"name": m.name, "gains": [{"name": g.name, "value": v}
                                       for g, v in zip(m.ranges, found.gains[m.name], strict=True)]}
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
