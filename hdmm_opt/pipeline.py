"""The main job: study -> reference -> gains -> proof -> validation -> gain file."""

from __future__ import annotations

import math
import os
import platform
import time
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from importlib import metadata
from typing import Any

from stability import Certificate, Failure, Gains, checker

from . import gain_file, validation
from .axis import KINDS
from .errors import DefectError
from .falsification import contradiction, falsify, stored
from .problem import Problem, assemble, resolved
from .proof import Verdict, candidates, compared, diagnose, longest_period, strongest, violation
from .selection import Options, Progress, search, starting_point
from .state import State
from .study import Study


@dataclass(frozen=True, kw_only=True)
class Effort:
    """How much a design may cost.

    Attributes:
        population: Candidates of the search.
        iterations: Evaluations of each after the first.
        monte_carlo: Runs with random scenarios.
        falsify: Runs that try to break the proof.
    """

    population: int
    iterations: int
    monte_carlo: int
    falsify: int


#: `--budget full`.
FULL = Effort(population=50, iterations=100, monte_carlo=1000, falsify=10_000)


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
    effort = _effort(study, options)
    job = {"design": resolved(problem), "seed": seed, "effort": asdict(effort)}
    state = State(options.state, job, resume=options.resume)
    progress.stage("gains: convex selection")
    chosen = starting_point(problem)
    gains, spent = chosen.gains, {"evaluations": chosen.rounds, "search_runs": 0}
    if problem.searched and effort.iterations:
        progress.stage(f"gains: {study.tuning.method}")
        budget = (effort.population, effort.iterations)
        picked = search(problem, chosen, budget, seed, options, state, progress)
        gains, spent = picked.gains, {"evaluations": picked.evaluations, "search_runs": picked.runs}
    progress.stage("proof")
    tried = candidates(problem, gains)
    found = strongest(problem, gains, tried)
    if isinstance(found, Failure) or violation(problem, found, gains) > 0:
        return _refused(problem, gains)
    document, missed = _validated(problem, gains, found, effort, seed, options, state, progress)
    progress.stage("exact check")
    made = provenance(seed, options, spent, begun)
    finished, report = gain_file.prove({**document, "provenance": made})
    verdicts = tuple(from_checker(report))
    accepted = report.status == 0 and not missed
    notes = (compared(problem, gains, tried, found), _rates(problem, gains)) if accepted else ()
    return Design(
        document=finished if accepted else None, report=report, verdicts=verdicts, missed=missed, gains=gains,
        notes=notes,
    )  # fmt: skip


def _validated(
    problem: Problem, gains: tuple[Gains, ...], found: Certificate, effort: Effort, seed: int, options: Options,
    state: State, progress: Progress,
) -> tuple[dict[str, Any], tuple[str, ...]]:  # fmt: skip
    """The document of proved gains after the simulations that must agree with it, and the requirements they missed.

    Raises:
        DefectError: a simulation did what the certificate excludes.
    """
    progress.stage("validation")
    shown = validation.validate(
        problem, gains, seed=seed, monte_carlo=effort.monte_carlo, jobs=options.jobs,
        progress=lambda part: progress.update(0.0, part),
    )  # fmt: skip
    if not shown.largest_error <= found.radii[0]:
        raise DefectError(
            f"a simulation reached {shown.largest_error:.6g} m, outside the certified {found.radii[0]:.6g} m; "
            "no file was written, please report this study"
        )
    document = gain_file.build(problem, gains, found, validation.to_data(problem, shown, found), {})
    if not effort.falsify:
        return document, shown.missed
    progress.stage("falsification")
    known = [s for s, _ in (*shown.runs, *([shown.worst] if shown.worst else []))]
    witness = falsify(problem, gains, known, effort.falsify, seed, progress.update, jobs=options.jobs, state=state)
    broken = contradiction(document, witness)
    if broken is not None:
        raise DefectError(f"{broken}; no file was written, please report this study")
    return stored(document, witness), shown.missed


def _rates(problem: Problem, gains: tuple[Gains, ...]) -> str:
    longest = longest_period(problem, gains)
    return f"certified up to a control period of {longest * 1e3:.4g} ms ({1 / longest:.4g} Hz), not found beyond"


def _effort(study: Study, options: Options) -> Effort:
    if options.full:
        return FULL
    tuning, validation = study.tuning, study.validation
    return Effort(
        population=tuning.population, iterations=tuning.iterations, monte_carlo=validation.monte_carlo,
        falsify=validation.falsify,
    )  # fmt: skip


def _refused(problem: Problem, gains: tuple[Gains, ...]) -> Design:
    return Design(document=None, report=None, verdicts=tuple(diagnose(problem, gains)), missed=(), gains=gains)


def from_checker(report: checker.Report) -> list[Verdict]:
    """What the checker did not prove, as verdicts."""
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
        "obligations": verdicts_data(design_.verdicts),
        "missed": list(design_.missed),
    }  # fmt: skip


def verdicts_data(verdicts: Sequence[Verdict]) -> list[dict[str, Any]]:
    """The `obligations` section of a rejected file."""
    return [
        {"name": v.name, "statement": v.statement, "margin": _finite(v.margin), "unit": v.unit,
         "verdict": v.verdict, "remedy": v.remedy, "witness": v.witness}
        for v in verdicts
    ]  # fmt: skip


def _finite(value: float) -> float | None:
    return value if math.isfinite(value) else None


def provenance(seed: int, options: Options, spent: dict[str, int], begun: float) -> dict[str, Any]:
    """The `provenance` section of a gain file."""
    packages = ("hdmm-opt", "casadi", "cvxpy", "clarabel", "llvmlite", "numpy", "scipy")
    return {
        "versions": {"python": platform.python_version(), **{name: _version(name) for name in packages}},
        "seed": seed,
        "budget": "full" if options.full else "quick",
        **spent,
        "wall_time_s": round(time.perf_counter() - begun, 3),
        "threads": options.jobs,
        "cpus": os.cpu_count(),
    }


def _version(name: str) -> str:
    try:
        return metadata.version(name)
    except metadata.PackageNotFoundError:
        return "unknown"
