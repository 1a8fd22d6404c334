"""An attack on a proved file."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from ..errors import DefectError
from ..files.restore import offered, restored
from ..files.result import Witness
from ..files.state import State
from ..files.validation import contradiction
from ..problem import Problem
from .falsification import falsify
from .options import Progress


def attacked(
    document: Mapping[str, Any], budget: int, seed: int, progress: Progress, *, jobs: int = 1,
    kept: Path | None = None, resume: bool = False,
) -> tuple[Problem, Witness]:  # fmt: skip
    """Search the worst run inside the assumptions of a proved file.

    Args:
        document: The file; that it is proved is the caller's to check.
        budget: Number of runs.
        seed: Seed of the search.
        progress: Where to report.
        jobs: Threads.
        kept: File that keeps the state; None keeps none.
        resume: Go on from that file.

    Returns:
        The problem of the file, and the worst run.

    Raises:
        DefectError: a run left the certified envelope.
    """
    problem, gains = restored(document)
    known = offered(document, problem)
    loop = next(iter(known.values()))[0]
    state = State(kept, {"falsify": document["sha256"], "budget": budget, "seed": seed}, resume=resume)
    progress.stage("falsify")
    scenarios = [scenario for _, scenario in known.values()]
    found = falsify(loop, gains, scenarios, budget, seed, progress.update, jobs=jobs, state=state)
    broken = contradiction(problem, dict(document), found)
    if broken is not None:
        raise DefectError(f"{broken}; please report this file with seed {seed}")
    return problem, found
