"""Actuator replacement: another actuator on one member; only its own proof is made anew."""

from __future__ import annotations

import math
import time
from collections.abc import Mapping
from dataclasses import replace
from typing import Any

from stability import Failure
from stability.networks.contracts import Contract, replaced

from ..errors import InvalidInputError
from ..files.restore import standing
from ..files.result import Design
from ..files.state import State
from ..problem import GainSet, Member, Problem
from ..problem.margins import certified_error, violation
from ..problem.problem import Contracts
from ..study import Study
from .certify import certificate
from .options import Options, Progress, effort_of
from .pipeline import finished
from .start import Tuned, bandwidths, with_bandwidths

#: Bandwidths that are tried for the new actuator, over those of the one before.
NEARBY = (1.0, 0.8, 1.2, 1.5)
#: What is told first of a candidate that is not taken.
BROKEN = "has guaranteed"


def replace_actuator(
    document: Mapping[str, Any], study: Study, name: str, options: Options, progress: Progress
) -> Design:
    """Put another actuator in the place of one, against the standing guarantees of all.

    Args:
        document: The proved file of the machine.
        study: The same study but for the plant and the gains of one member.
        name: The member whose actuator is another.
        options: Seed, threads.
        progress: Where to report.

    Returns:
        The design; the entries of all other members are taken over as they are. Refused where the candidate breaks the
        guarantee that the others were proved under.

    Raises:
        InvalidInputError: the study cannot be made concrete, or the machine has one member.
        DefectError: a simulation left its certified envelope.
    """
    begun = time.perf_counter()
    progress.stage("reference")
    problem, gains, contracts, before = standing(document, study, name)
    if len(problem.members) == 1:
        raise InvalidInputError("--exchange is for machines of several members: design this one anew")
    if not problem.linked:
        contracts = _alone(problem, gains, name)
    fixed = (
        item.low if item.fixed else value for item, value in zip(problem.member(name).ranges, gains[name], strict=True)
    )
    gains = {**gains, name: tuple(fixed)}  # what is not searched follows from the new actuator
    progress.stage(f"gains of {name}")
    tuned = _Nearby(problem, gains, contracts, name, before).search()
    kept = {entry["name"]: entry for entry in document["members"] if entry["name"] != name}
    return finished(
        problem, tuned, tuned.contracts, effort_of(study, options), options, State(None, {}, resume=False), progress,
        begun, kept=kept,
    )  # fmt: skip


def _alone(problem: Problem, gains: GainSet, name: str) -> Contracts:
    """The proofs of all members but one that nothing joins."""
    found = {m.name: certificate(m, gains[m.name], refine=True) for m in problem.members if m.name != name}
    made: Contracts = {}
    for key, one in found.items():
        if isinstance(one, Failure):
            raise InvalidInputError(f"{key} of this file is not proved by this release: design the machine anew")
        made[key] = Contract(guarantee=None, reached=None, bounds=problem.member(key).bounds, certificate=one)
    return made


class _Nearby:
    """Gains of the new actuator with bandwidths near those of the one before."""

    def __init__(self, problem: Problem, gains: GainSet, contracts: Contracts, name: str, before: Member) -> None:
        self.problem, self.gains, self.contracts, self.name = problem, gains, contracts, name
        self.widths = bandwidths(before, gains[name])
        self.tried: dict[tuple[float, ...], tuple[float, Tuned]] = {}

    def search(self) -> Tuned:
        """The best of all rows together, then of each row in turn, twice."""
        rows = len(self.widths)
        point = min(((factor,) * rows for factor in NEARBY), key=self._size)
        for row in [*range(rows)] * 2:
            others = [(*point[:row], factor, *point[row + 1 :]) for factor in NEARBY]
            point = min((point, *others), key=self._size)
        size, tuned = self.tried[point]
        broken = [
            t for _, t in self.tried.values() if isinstance(t.contracts, Failure) and BROKEN in t.contracts.reason
        ]
        return replace(broken[0] if math.isinf(size) and broken else tuned, evaluations=len(self.tried))

    def _size(self, point: tuple[float, ...]) -> float:
        """Certified error of the output, m; infinite for gains that are not proved under the standing guarantee."""
        if point not in self.tried:
            self.tried[point] = self._rated(point)
        return self.tried[point][0]

    def _rated(self, point: tuple[float, ...]) -> tuple[float, Tuned]:
        member = self.problem.member(self.name)
        widths = [factor * width for factor, width in zip(point, self.widths, strict=True)]
        together = {**self.gains, self.name: with_bandwidths(member, self.gains[self.name], widths)}
        found = self._proved(member, together)
        if isinstance(found, Failure):
            return math.inf, Tuned(gains=together, contracts=replace(found, together=True), evaluations=1)
        good = violation(self.problem, found, together) == 0.0
        size = certified_error(self.problem, found) if good else math.inf
        return size, Tuned(gains=together, contracts=found, evaluations=1)

    def _proved(self, member: Member, gains: GainSet) -> Contracts | Failure:
        """The proofs with the member's new one."""
        if self.problem.linked:
            changed = self.problem.subsystems(gains)[self.name]
            return replaced(self.contracts, self.problem.assume, self.name, changed)
        one = certificate(member, gains[self.name], refine=True)
        if isinstance(one, Failure):
            return one
        made = Contract(guarantee=None, reached=None, bounds=member.bounds, certificate=one)
        return {m.name: made if m is member else self.contracts[m.name] for m in self.problem.members}
