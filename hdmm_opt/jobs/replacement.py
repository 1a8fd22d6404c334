"""Actuator replacement: another actuator on one member; only its own proof is made anew."""

from __future__ import annotations

import math
import time
from collections.abc import Mapping
from dataclasses import replace
from typing import Any

from stability import Failure
from stability.networks.contracts import replaced

from ..errors import InvalidInputError
from ..files.restore import standing
from ..files.result import Design
from ..files.state import State
from ..problem import GainSet, Member, Problem
from ..problem.margins import certified_error, violation
from ..problem.problem import Contracts
from ..study import Study
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
        InvalidInputError: the study cannot be made concrete, or the machine has no coupling.
        DefectError: a simulation left its certified envelope.
    """
    begun = time.perf_counter()
    progress.stage("reference")
    problem, gains, contracts, before = standing(document, study, name)
    if not problem.linked:
        raise InvalidInputError("--exchange is for members that guarantee something: design this machine anew")
    progress.stage(f"gains of {name}")
    tuned = _Nearby(problem, gains, contracts, name, before).search()
    kept = {entry["name"]: entry for entry in document["members"] if entry["name"] != name}
    return finished(
        problem, tuned, tuned.contracts, effort_of(study, options), options, State(None, {}, resume=False), progress,
        begun, kept=kept,
    )  # fmt: skip


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
        found = replaced(self.contracts, self.problem.assume, self.name, self.problem.subsystems(together)[self.name])
        if isinstance(found, Failure):
            return math.inf, Tuned(gains=together, contracts=replace(found, together=True), evaluations=1)
        good = violation(self.problem, found, together) == 0.0
        size = certified_error(self.problem, found) if good else math.inf
        return size, Tuned(gains=together, contracts=found, evaluations=1)
