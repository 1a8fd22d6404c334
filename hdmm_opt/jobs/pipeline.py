"""The main job: study -> references -> gains -> proofs -> validation -> gain file."""

from __future__ import annotations

import time
from collections.abc import Mapping
from dataclasses import asdict
from typing import Any

from stability import Failure

from ..errors import DefectError
from ..files.gain_file import build
from ..files.provenance import provenance
from ..files.result import Design
from ..files.seal import prove
from ..files.state import State
from ..files.validation import contradiction, stored, to_data
from ..problem import Problem, assemble
from ..problem.margins import violation
from ..problem.problem import Contracts
from ..problem.resolved import resolved
from ..problem.verdict import from_checker
from ..simulation import Loop
from ..study import Study
from .certify import longest_period, refinable, strongest
from .condition import condition_lines
from .contributions import budget_lines, contribution_lines, contributions, together
from .falsification import falsify
from .options import FINE, Effort, Options, Progress, effort_of
from .polish import polished
from .refusal import refused
from .reserve import reserve_lines
from .search import search
from .start import Tuned, starting_point
from .validation import agree, validate


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
    seed, effort = options.seed_of(study), effort_of(study, options)
    job = {"design": resolved(problem), "seed": seed, "effort": asdict(effort)}
    state = State(options.state, job, resume=options.resume)
    progress.stage("gains: bandwidth cascades")
    tuned = starting_point(problem, progress)
    if problem.searched and effort.iterations:
        progress.stage(f"gains: {study.tuning.method}")
        fine = options.full and refinable(problem) and study.tuning.method != "gradient"
        budget = FINE if fine else (effort.population, effort.iterations)
        tuned = search(problem, tuned, study.tuning.method, budget, seed, options, state, progress, refine=fine)
        if options.full:
            progress.stage("gains: pattern search with refined proofs")
            tuned = polished(problem, tuned, options, progress)
    progress.stage("proof")
    best = strongest(problem, tuned.gains)
    return finished(problem, tuned, best.contracts, effort, options, state, progress, begun, notes=best.notes)


def finished(
    problem: Problem, tuned: Tuned, contracts: Contracts | Failure, effort: Effort, options: Options, state: State,
    progress: Progress, begun: float, *, notes: tuple[str, ...] = (),
    kept: Mapping[str, dict[str, Any]] | None = None,
) -> Design:  # fmt: skip
    """Validation and exact check of gains, or why they are refused.

    Args:
        problem: The problem.
        tuned: The gains, and what they cost.
        contracts: Their best proofs, or why there are none.
        effort: How many runs validation may cost.
        options: Seed, threads.
        state: Keeps the answers of the attack.
        progress: Where to report.
        begun: When the job began.
        notes: What is told of the proofs of an accepted design.
        kept: Entries of members of a proved file that are taken over as they are.
    """
    loop, seed = Loop(problem), options.seed_of(problem.study)
    progress.stage("validation")
    if isinstance(contracts, Failure) or violation(problem, contracts, tuned.gains) > 0:
        return refused(problem, loop, tuned.gains, contracts)
    shown = validate(
        loop, tuned.gains, seed=seed, monte_carlo=effort.monte_carlo, jobs=options.jobs,
        progress=lambda part: progress.update(0.0, part),
    )  # fmt: skip
    agree(problem, contracts, shown)
    document = build(loop, tuned.gains, contracts, to_data(problem, shown), kept=kept)
    if effort.falsify:
        progress.stage("falsification")
        known = [s for s, _ in (*shown.runs, *([shown.worst] if shown.worst else []))]
        witness = falsify(
            loop, tuned.gains, known, effort.falsify, seed, progress.update, jobs=options.jobs, state=state
        )
        broken = contradiction(problem, document, witness)
        if broken is not None:
            raise DefectError(f"{broken}; no file was written, please report this study")
        document = stored(problem, document, witness)
    progress.stage("exact check")
    spent = {"evaluations": tuned.evaluations, "search_runs": tuned.runs}
    made = provenance(seed, options.jobs, "full" if options.full else "quick", spent, begun)
    proved, report = prove({**document, "provenance": made})
    if report.records and not shown.missed:
        raise DefectError(f"{report.records}; no file was written, please report this study")
    accepted = report.status == 0 and not shown.missed
    parts: tuple[str, ...] = ()
    if accepted and kept is None:
        notes = (*notes, _rates(problem, tuned, refine=options.full and refinable(problem)))
        progress.stage("contributions")
        shares = contribution_lines(problem, contributions(problem, tuned.gains))
        condition = condition_lines(problem, tuned.gains, contracts)
        reserve = reserve_lines(problem, tuned.gains, contracts) if options.full else []
        budget = together(problem, budget_lines(problem, tuned.gains, contracts))
        parts = (*budget, *reserve, *shares, *together(problem, condition))
    return Design(
        document=proved if accepted else None, report=report, verdicts=tuple(from_checker(report)),
        missed=shown.missed, gains=tuned.gains, problem=problem, shown=shown, notes=notes, parts=parts,
    )  # fmt: skip


def _rates(problem: Problem, tuned: Tuned, *, refine: bool) -> str:
    own, longest = problem.period, longest_period(problem, tuned.gains, proved=True, refine=refine)
    if not longest > own:
        return f"with these gains no control rate below {1 / own:.4g} Hz was found at which it is proved"
    return f"with these gains a control rate down to {1 / longest:.4g} Hz ({longest * 1e3:.4g} ms) is proved too"
