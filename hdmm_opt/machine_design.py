"""The main job for machines: references -> gains -> proofs joint by joint -> coupled validation -> gain file."""

from __future__ import annotations

import math
import time
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from itertools import product
from typing import Any

import numpy as np

from stability import Failure, Gains, checker
from stability.network import Contract, exchange

from . import gain_file
from .axis import Axis
from .errors import DefectError
from .machine_again import standing
from .machine_file import assumed, build_machine, resolved_machine
from .machine_gains import (
    GainSet,
    Tuned,
    bandwidths,
    covered,
    machine_scenarios,
    named_gains,
    shortfall,
    starting_gains,
    tuned_gains,
    uses,
    with_bandwidths,
)
from .machine_loop import MachineFigures, MachineLoop, MachineScenario
from .machine_problem import MachineProblem, assemble_machine, tool_errors
from .machine_study import MachineStudy
from .pipeline import FULL, from_checker, provenance, verdicts_data
from .proof import Verdict
from .selection import Options, Progress
from .state import State


@dataclass(frozen=True, kw_only=True)
class MachineDesign:
    """A finished run.

    Attributes:
        document: The gain file; None where the design was refused.
        report: The checker's report on it; None where no certificate was found.
        verdicts: What failed, the cause first; empty for a proved design that meets its requirements.
        missed: Requirements that a simulation missed.
        gains: The gains by joint.
        shown: What the simulations showed, by scenario.
        problem: What was worked on.
    """

    document: dict[str, Any] | None
    report: checker.Report | None
    verdicts: tuple[Verdict, ...]
    missed: tuple[str, ...]
    gains: GainSet
    shown: Mapping[str, MachineFigures]
    problem: MachineProblem


def design_machine(study: MachineStudy, options: Options, progress: Progress) -> MachineDesign:
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
    problem = assemble_machine(study)
    seed = study.tuning.seed if options.seed is None else options.seed
    budget = (FULL.population, FULL.iterations) if options.full else (study.tuning.population, study.tuning.iterations)
    draws = FULL.monte_carlo if options.full else study.validation.monte_carlo
    job = {"machine": resolved_machine(problem), "seed": seed, "budget": [*budget, draws]}
    state = State(options.state, job, resume=options.resume)
    progress.stage("gains: ladders")
    tuned = starting_gains(problem, progress)
    if any(axis.searched for axis in problem.axes) and budget[1]:
        progress.stage(f"gains: {study.tuning.method}")
        tuned = tuned_gains(problem, tuned, study.tuning.method, budget, seed, options, state, progress)
    return _finished(problem, tuned, draws, seed, options, progress, begun)


def _finished(
    problem: MachineProblem, tuned: Tuned, draws: int, seed: int, options: Options, progress: Progress, begun: float, *,
    kept: Mapping[str, dict[str, Any]] | None = None,
) -> MachineDesign:  # fmt: skip
    """Validation and exact check of gains, or why they are refused."""
    progress.stage("validation")
    loop = MachineLoop(problem)
    shown, section = validated_machine(problem, loop, tuned, draws, seed, options.jobs)
    by_name = {s.name: m for s, m in shown}
    refused = _witnessed(problem, _refused(problem, tuned), shown)
    if refused or isinstance(tuned.contracts, Failure):
        return MachineDesign(
            document=None, report=None, verdicts=tuple(refused), missed=(), gains=tuned.gains, shown=by_name,
            problem=problem,
        )  # fmt: skip
    _agrees(problem, tuned.contracts, section)
    progress.stage("exact check")
    spent = {"evaluations": tuned.evaluations, "search_runs": tuned.runs}
    section["requirements"] = _requirements(problem, shown)
    made = provenance(seed, options, spent, begun)
    document = build_machine(problem, tuned.gains, tuned.contracts, section, made, kept=kept)
    finished, report = gain_file.prove(document)
    missed = tuple(_missed(problem, shown))
    accepted = report.status == 0 and not missed
    return MachineDesign(
        document=finished if accepted else None, report=report, verdicts=tuple(from_checker(report)), missed=missed,
        gains=tuned.gains, shown=by_name, problem=problem,
    )  # fmt: skip


def exchanged(
    document: Mapping[str, Any], study: MachineStudy, joint: str, options: Options, progress: Progress
) -> MachineDesign:
    """Put another actuator in the place of one: only its own proof is made anew, against the standing promises.

    Args:
        document: The proved file of the machine.
        study: The same study but for the plant and the gains of one joint.
        joint: The joint whose actuator is another.
        options: Seed, threads.
        progress: Where to report.

    Returns:
        The design; the documents of all other joints are taken over as they are. Refused where the newcomer breaks
        the promise that the others were proved under.

    Raises:
        InvalidInputError: the study cannot be made concrete.
        DefectError: a simulation left its certified envelope.
    """
    begun = time.perf_counter()
    progress.stage("reference")
    problem, gains, contracts, before = standing(document, study, joint)
    candidates = _newcomers(problem, joint, (before, gains[joint]))
    best: Tuned | None = None
    least, why = math.inf, Failure(reason=f"{joint}: no gains keep the standing promise")
    progress.stage(f"gains of {joint}")
    for own in candidates:
        together = {**gains, joint: own}
        found = exchange(contracts, problem.assume, joint, problem.subsystems(together)[joint])
        if isinstance(found, Failure):
            why = found if "has promised" in found.reason or best is None else why
            continue
        lacking = shortfall(problem, found, together)
        size = uses(problem, found)[-1][1]
        if lacking == 0.0 and size < least:
            least, best = size, Tuned(gains=together, contracts=found, evaluations=len(candidates))
    tuned = best or Tuned(gains={**gains, joint: candidates[0]}, contracts=why, evaluations=len(candidates))
    seed = study.tuning.seed if options.seed is None else options.seed
    kept = {name: dict(document["joints"][name]) for name in problem.machine.joints if name != joint}
    return _finished(problem, tuned, study.validation.monte_carlo, seed, options, progress, begun, kept=kept)


#: Bandwidths that are tried for an actuator that is exchanged, over those of the one before.
NEARBY = (0.8, 1.0, 1.2, 1.5)


def _newcomers(problem: MachineProblem, joint: str, before: tuple[Axis, tuple[Gains, ...]]) -> list[tuple[Gains, ...]]:
    """Gains of an exchanged actuator with bandwidths near those of the one before."""
    k = problem.machine.joints.index(joint)
    old = bandwidths(*before)
    factors = [(*part, *[part[-1]] * (len(old) - len(part))) for part in product(NEARBY, repeat=min(3, len(old)))]
    return [
        with_bandwidths(problem.axes[k], before[1], [f * w for f, w in zip(row, old, strict=True)]) for row in factors
    ]


def validated_machine(
    problem: MachineProblem, loop: MachineLoop, tuned: Tuned, draws: int, seed: int, jobs: int
) -> tuple[list[tuple[MachineScenario, MachineFigures]], dict[str, Any]]:
    """Runs of all scenarios and of random draws, and what a gain file records of them.

    Scenarios outside the assumptions, such as a stuck joint, are shown and count for nothing.
    """
    given = machine_scenarios(problem.study)
    drawn = _draws(problem, draws, seed)
    shown = loop.figures([(tuned.gains, s) for s in (*given, *drawn)], jobs=jobs)
    runs = list(zip(given, shown, strict=False))
    inside = [m for s, m in zip((*given, *drawn), shown, strict=True) if covered(problem, s)]
    joints = problem.machine.joints

    def largest(part: str, k: int) -> float:
        return max((getattr(m, part)[k] for m in inside), default=0.0)

    section: dict[str, Any] = {
        "largest_error_m": max((m.tool for m in inside), default=0.0),
        "largest_error_after_transient_m": max((m.tool_late for m in inside), default=0.0),
        "simulated_runs": len(inside),
        "joints": {
            name: {"largest_error": largest("joints_ever", k), "after_transient": largest("joints", k),
                   "unit": problem.axes[k].plant.state_units[0]}
            for k, name in enumerate(joints)
        },
        "estimates": {
            name: {"position": max(m.estimates[k][0] for m in inside), "speed": max(m.estimates[k][1] for m in inside)}
            for k, name in enumerate(joints) if inside and inside[0].estimates
        },
        "scenarios": [
            {"name": s.name, "covered": covered(problem, s), **figures_data(m)} for s, m in runs
        ],
    }  # fmt: skip
    return runs, section


def figures_data(figures: MachineFigures) -> dict[str, Any]:
    """Figures as JSON data; what is not finite, in a run that was lost, is null."""

    def plain(value: Any) -> Any:
        if isinstance(value, tuple):
            return [plain(v) for v in value]
        return value if math.isfinite(value) else None

    return {key: plain(value) for key, value in asdict(figures).items()}


def _draws(problem: MachineProblem, count: int, seed: int) -> list[MachineScenario]:
    """Random scenarios inside the assumptions: half of them at corners of the parameters."""
    random = np.random.default_rng(seed)
    low, high = problem.study.uncertainty.payload_kg
    names = [
        f"{joint}.{key}" for joint, plant in zip(problem.machine.joints, problem.machine.plants, strict=True)
        for key, p in plant.parameters.items() if p.tolerance > 0
    ]  # fmt: skip
    made = []
    for k in range(count):
        shares = random.choice((-1.0, 1.0), len(names)) if k % 2 else random.uniform(-1, 1, len(names))
        made.append(MachineScenario(
            name=f"draw-{k}", payload=float(random.uniform(low, high)),
            parameters=dict(zip(names, map(float, shares), strict=True)), noise=1.0,
            initial=float(random.uniform(-1, 1)), seed=seed + 1000 + k,
        ))  # fmt: skip
    return made


def _agrees(problem: MachineProblem, contracts: Mapping[str, Contract], section: Mapping[str, Any]) -> None:
    """Stop where a simulation did what the certificates exclude."""
    for k, name in enumerate(problem.machine.joints):
        radius = float(contracts[name].certificate.radii[0])
        seen = section["joints"][name]["largest_error"]
        noise = contracts[name].bounds.noise
        watched = section["estimates"].get(name, {"position": 0.0, "speed": 0.0})
        pairs = [(seen, radius, "error")]
        pairs += [(watched["position"], noise[0], "estimation error"), (watched["speed"], noise[1], "speed estimate")]
        for reached, bound, what in pairs[: 3 if section["estimates"] else 1]:
            if not reached <= bound:
                unit = problem.axes[k].plant.state_units[0]
                raise DefectError(
                    f"a simulation reached an {what} of {reached:.6g} {unit} in {name}, outside the certified "
                    f"{bound:.6g}; no file was written, please report this study"
                )
    radii = np.array([contracts[name].certificate.radii[0] for name in problem.machine.joints])
    envelope = tool_errors(problem, radii)
    if not section["largest_error_m"] <= envelope:
        raise DefectError(
            f"a simulation moved the tool {section['largest_error_m']:.6g} m away, outside the certified "
            f"{envelope:.6g} m; no file was written, please report this study"
        )


def _requirements(
    problem: MachineProblem, shown: Sequence[tuple[MachineScenario, MachineFigures]]
) -> list[dict[str, Any]]:
    study = problem.study.requirements
    inside = [m for s, m in shown if covered(problem, s)]
    rows = [{"name": "tool_error_m", "required": study.tool_error_m,
             "simulated": max((m.tool_late for m in inside), default=0.0)}]  # fmt: skip
    for k, name in enumerate(problem.machine.joints):
        rows.append({
            "name": f"joint_error.{name}", "required": study.joint_error[name],
            "simulated": max((m.joints[k] for m in inside), default=0.0),
        })  # fmt: skip
    return rows


def _missed(problem: MachineProblem, shown: Sequence[tuple[MachineScenario, MachineFigures]]) -> list[str]:
    return [
        f"{row['name']}: required {row['required']:g}, simulated {row['simulated']:.4g}"
        for row in _requirements(problem, shown) if not row["simulated"] <= row["required"]
    ]  # fmt: skip


def _refused(problem: MachineProblem, tuned: Tuned) -> list[Verdict]:
    """Why gains have no certificate, the cause first."""
    if isinstance(tuned.contracts, Failure):
        alone = problem.alone(tuned.gains)
        stuck = [
            name for name, plant in zip(problem.machine.joints, problem.machine.plants, strict=True)
            if "effectiveness" in plant.parameters and plant.parameters["effectiveness"].tolerance >= 1.0
        ]  # fmt: skip
        if stuck:
            return [Verdict(
                name="authority", margin=-math.inf, unit="1", verdict="undecided",
                statement=f"the actuator of {' and '.join(stuck)} may deliver nothing: no gain holds a stuck joint",
                remedy="least_effectiveness above 0 for every joint",
            )]  # fmt: skip
        if alone is not None:
            return [Verdict(
                name="contraction", margin=alone.margin, unit="1/s", verdict="undecided", statement=alone.reason,
                remedy="other gains or a faster rate",
            )]  # fmt: skip
        return [Verdict(
            name="coupling", margin=-math.inf, unit="1", verdict="undecided",
            statement=f"each joint is proved alone, not all together: {tuned.contracts.reason}",
            remedy="more inertia of the actuators, a motion nearer to the base, less uncertainty, or other gains",
        )]  # fmt: skip
    broken = [(name, size, limit, unit) for name, size, limit, unit in uses(problem, tuned.contracts)
              if size / limit - 1 > 0]  # fmt: skip
    return [
        Verdict(
            name="accuracy" if name.endswith("error") else "authority", margin=limit - size, unit=unit,
            verdict="undecided", statement=f"the certified set asks for {size:.4g} {unit} of {name} of {limit:.4g}",
            remedy=f"{'a requirement' if name.endswith('error') else 'a limit'} of {1.01 * size:.4g} {unit}",
        )
        for name, size, limit, unit in sorted(broken, key=lambda row: row[2] / row[1])
    ]  # fmt: skip


def _witnessed(
    problem: MachineProblem, verdicts: list[Verdict], shown: Sequence[tuple[MachineScenario, MachineFigures]]
) -> list[Verdict]:
    """The verdicts, the first of them refuted where a run inside the assumptions missed what is required."""
    required = problem.study.requirements.tool_error_m
    for scenario, m in shown:
        if verdicts and covered(problem, scenario) and not m.tool_late <= required:
            seen = f"is lost at {m.lost:.3g} s" if math.isfinite(m.lost) else f"reaches {1e3 * m.tool_late:.4g} mm"
            text = f'{verdicts[0].statement}; simulated with scenario "{scenario.name}" the tool {seen}'
            witness = {"scenario": {"name": scenario.name}, "rate_hz": problem.study.controller.rate_hz}
            return [replace(verdicts[0], verdict="refuted", statement=text, witness=witness), *verdicts[1:]]
    return verdicts


def rejected_machine(result: MachineDesign) -> dict[str, Any]:
    """What a refused design leaves behind: the study, the gains, what failed, and what the simulations showed."""
    return {
        "schema": gain_file.REJECTED,
        "study": result.problem.study.model_dump(mode="json", exclude_none=True),
        "gains": [{"name": name, "value": value} for name, value in named_gains(result.gains).items()],
        "obligations": verdicts_data(result.verdicts),
        "missed": list(result.missed),
        "simulated": {name: figures_data(m) for name, m in result.shown.items()},
        "assumed": list(assumed(result.problem)),
    }  # fmt: skip
