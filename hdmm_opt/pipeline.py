"""The main job: study -> reference -> gains -> proof -> validation -> gain file."""

from __future__ import annotations

import math
import os
import platform
import time
from dataclasses import dataclass
from importlib import metadata
from typing import Any

from stability import Failure, Gains, checker

from . import gain_file, validation
from .errors import DefectError
from .problem import KINDS, Problem, assemble
from .proof import Verdict, candidates, compared, diagnose, longest_period, strongest, violation
from .selection import Options, Progress, search, starting_point
from .study import Study

#: Population, iterations and Monte Carlo runs of `--budget full`.
FULL = (50, 100, 1000)


@dataclass(frozen=True, kw_only=True)
class Design:
    """A finished run.

    Attributes:
        document: The gain file; None where the design was refused.
        report: The checker's report on it; None where no certificate was found.
        verdicts: What failed, the cause first; empty for a proved design that meets its requirements.
        missed: Requirements that a simulation missed.
        gains: The gains.
        notes: Which certificate was taken, and the longest control period at which the gains are proved.
    """

    document: dict[str, Any] | None
    report: checker.Report | None
    verdicts: tuple[Verdict, ...]
    missed: tuple[str, ...]
    gains: tuple[Gains, ...]
    notes: tuple[str, ...] = ()


def design(study: Study, options: Options, progress: Progress) -> Design:
    """Run the whole pipeline.

    Args:
        study: A validated study.
        options: Seed, processes, budget.
        progress: Where to report.

    Returns:
        The design; proved by the checker, or with what failed.

    Raises:
        InvalidInputError: the study cannot be made concrete, or a state file does not fit it.
        DefectError: a simulation left its certified envelope.
    """
    begun = time.perf_counter()
    progress.stage("reference")
    problem = assemble(study)
    seed = study.tuning.seed if options.seed is None else options.seed
    progress.stage("gains: convex selection")
    chosen = starting_point(problem)
    gains, evaluations = chosen.gains, chosen.rounds
    budget = _budget(study, options)
    if problem.searched and budget[1]:
        progress.stage("gains: JAYA")
        gains, evaluations = search(problem, chosen.gains, budget, seed, options, progress)
    progress.stage("proof")
    tried = candidates(problem, gains)
    found = strongest(problem, gains, tried)
    if isinstance(found, Failure) or violation(problem, found, gains) > 0:
        return _refused(problem, gains)
    progress.stage("validation")
    shown = validation.validate(
        problem, gains, seed=seed, monte_carlo=budget[2], progress=lambda part: progress.update(0.0, part)
    )
    if not shown.largest_error <= found.radii[0]:
        raise DefectError(
            f"a simulation reached {shown.largest_error:.6g} m, outside the certified {found.radii[0]:.6g} m; "
            "no file was written, please report this study"
        )
    provenance = _provenance(seed, options, evaluations, begun)
    document = gain_file.build(problem, gains, found, validation.to_data(problem, shown, found), provenance)
    progress.stage("exact check")
    finished, report = gain_file.prove(document)
    verdicts = tuple(_from_checker(report))
    accepted = report.status == 0 and not shown.missed
    return Design(
        document=finished if accepted else None, report=report, verdicts=verdicts, missed=shown.missed, gains=gains,
        notes=(compared(problem, gains, tried, found), _rates(problem, gains)) if accepted else (),
    )  # fmt: skip


def _rates(problem: Problem, gains: tuple[Gains, ...]) -> str:
    longest = longest_period(problem, gains)
    return f"certified up to a control period of {longest * 1e3:.4g} ms ({1 / longest:.4g} Hz), not found beyond"


def _budget(study: Study, options: Options) -> tuple[int, int, int]:
    if options.full:
        return FULL
    return study.tuning.population, study.tuning.iterations, study.validation.monte_carlo


def _refused(problem: Problem, gains: tuple[Gains, ...]) -> Design:
    return Design(document=None, report=None, verdicts=tuple(diagnose(problem, gains)), missed=(), gains=gains)


def _from_checker(report: checker.Report) -> list[Verdict]:
    if report.status == 0:
        return []
    failed = [
        Verdict(
            name=o.name, statement=o.statement, margin=o.margin, unit=o.unit, verdict=o.verdict,
            remedy=o.remedy, sure=True,
        )
        for o in report.obligations
        if o.verdict != "proved"
    ]  # fmt: skip
    return failed or [
        Verdict(name="exact check", statement=report.message, margin=-1.0, unit="1", verdict="undecided", remedy="")
    ]


def rejected_document(problem_study: Study, design_: Design) -> dict[str, Any]:
    """What a refused design leaves behind: the study, the gains, and what failed."""
    return {
        "schema": gain_file.REJECTED,
        "study": problem_study.model_dump(mode="json", exclude_none=True),
        "gains": [
            {"name": f"{kind}_{k + 1}", "value": getattr(g, kind)}
            for k, g in enumerate(design_.gains)
            for kind in KINDS
        ],
        "obligations": [
            {"name": v.name, "statement": v.statement, "margin": _finite(v.margin), "unit": v.unit,
             "verdict": v.verdict, "remedy": v.remedy, "witness": v.witness}
            for v in design_.verdicts
        ],
        "missed": list(design_.missed),
    }  # fmt: skip


def _finite(value: float) -> float | None:
    return value if math.isfinite(value) else None


def _provenance(seed: int, options: Options, evaluations: int, begun: float) -> dict[str, Any]:
    packages = ("hdmm-opt", "casadi", "cvxpy", "clarabel", "numpy", "scipy")
    return {
        "versions": {"python": platform.python_version(), **{name: _version(name) for name in packages}},
        "seed": seed,
        "budget": "full" if options.full else "quick",
        "evaluations": evaluations,
        "wall_time_s": round(time.perf_counter() - begun, 3),
        "threads": options.jobs,
        "cpus": os.cpu_count(),
    }


def _version(name: str) -> str:
    try:
        return metadata.version(name)
    except metadata.PackageNotFoundError:
        return "unknown"
