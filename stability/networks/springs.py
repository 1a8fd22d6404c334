"""Loops that push each other through springs: the simplest coupling, for tests and measurements."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

from ..enclosures.interval import Interval
from ..loops.model import Bounds
from .contracts import Assume
from .coupling import Tube


@dataclass(frozen=True, kw_only=True)
class Coupling:
    """The first deviation of one subsystem is part of a disturbance of another.

    Attributes:
        source: Name of the subsystem that pushes.
        target: Name of the subsystem that is pushed.
        disturbance: Name of the disturbance there.
        gain: Largest |w| per |z_1| of the source.
    """

    source: str
    target: str
    disturbance: str
    gain: float


def coupled(alone: Mapping[str, Bounds], couplings: Sequence[Coupling]) -> Assume:
    """The assumptions of loops that push each other through springs.

    Args:
        alone: The assumptions of each, without its neighbours.
        couplings: Who pushes whom.

    Raises:
        KeyError: a coupling names an unknown subsystem or disturbance.
    """
    for coupling in couplings:
        _ = alone[coupling.source], alone[coupling.target].disturbances[coupling.disturbance]

    def assume(guarantees: Mapping[str, Tube]) -> dict[str, Bounds]:
        found = dict(alone)
        for coupling in couplings:
            push = Interval.symmetric(coupling.gain * guarantees[coupling.source].position * (1 + 1e-12))
            bounds = found[coupling.target]
            disturbances = dict(bounds.disturbances)
            disturbances[coupling.disturbance] = disturbances[coupling.disturbance] + push
            found[coupling.target] = replace(bounds, disturbances=disturbances)
        return found

    return assume
