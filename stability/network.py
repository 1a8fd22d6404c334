"""Modular proofs: many loops that push each other, each proved against what its neighbours promise.

Every subsystem promises a tube: bounds on |z_1|, |z_2| and |z_2'| for all t, position, speed and acceleration for a
mechanical axis. It is proved with what the neighbours' promises make of its disturbances and of its measurement errors.
Where all proofs hold together no promise can be the first to be broken; the promises are found as the fixed point of
"promises -> assumptions -> proofs -> promises". A subsystem that is exchanged is proved anew against the standing
assumptions; if it keeps its own promise, no other proof changes.

References:
    Siljak (1978), Large-Scale Dynamic Systems, ch. 2, for comparison systems of interconnections.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from .certificate import Failure
from .coupling import Tube
from .deviation import deviation_rows
from .interval import Interval
from .model import Bounds, Gains, LoopModel
from .sampled import Sampled, certify_sampled, speeds

Array = NDArray[np.float64]

#: A promise is this much wider than what is needed, so that a subsystem may change a little without breaking it.
ROOM = 1.02
#: Assumptions grow by this factor over what an iterate needs.
WIDENING = 1.004
ROUNDS = 60
#: Ratio of successive gaps below which the iteration is extrapolated, and the share of that which is believed.
STEEPEST, TRUSTED = 0.95, 0.8


@dataclass(frozen=True, kw_only=True)
class Subsystem:
    """One loop.

    Attributes:
        model: Plant and law; at least two rows.
        gains: One for each governed row.
        limit: Largest admissible box, |z_i| <= limit_i. Shape (n,).
    """

    model: LoopModel
    gains: tuple[Gains, ...]
    limit: Array


@dataclass(frozen=True, kw_only=True)
class Contract:
    """A subsystem's promise, and its proof against the promises of its neighbours.

    Attributes:
        promise: What holds for all t.
        reached: What the certificate gives; inside the promise.
        bounds: The assumptions of the proof, neighbours included.
        certificate: The certificate; `checker.py` decides it.
    """

    promise: Tube
    reached: Tube
    bounds: Bounds
    certificate: Sampled


#: From the promises to the assumptions that each subsystem is proved under.
Assume = Callable[[Mapping[str, Tube]], Mapping[str, Bounds]]


def compose(subsystems: Mapping[str, Subsystem], assume: Assume) -> dict[str, Contract] | Failure:
    """Contracts that hold together.

    Args:
        subsystems: The loops by name.
        assume: What the promises of all make of each one's disturbances and measurement errors; wider promises must
            give wider assumptions.

    Returns:
        A contract for each subsystem, or why there are none. The work grows linearly with their number.
    """
    nothing = Tube(position=0.0, speed=0.0, acceleration=0.0)
    assumed = dict(assume(dict.fromkeys(subsystems, nothing)))
    gap: Array | None = None
    for _ in range(ROUNDS):
        made: dict[str, Contract] = {}
        for name, own in subsystems.items():
            found = prove(name, own, assumed[name])
            if isinstance(found, Failure):
                return found
            made[name] = found
        needed = assume({name: contract.promise for name, contract in made.items()})
        if all(covers(assumed[name], needed[name]) for name in subsystems):
            return made
        have, want = (np.concatenate([_sizes(part[name]) for name in subsystems]) for part in (assumed, needed))
        target, gap = _ahead(have, want, gap), np.maximum(want - have, 0.0)
        grown = np.divide(target, want, out=np.ones_like(want), where=want > 0)
        for name in subsystems:
            count = len(_sizes(needed[name]))
            assumed[name] = _grown(assumed[name], needed[name], WIDENING * grown[:count])
            grown = grown[count:]
    return Failure(reason=f"the promises did not settle in {ROUNDS} rounds: the couplings are too strong")


def exchange(
    contracts: Mapping[str, Contract], assume: Assume, name: str, changed: Subsystem
) -> dict[str, Contract] | Failure:
    """Put another subsystem in the place of one; only its own proof is made anew.

    Args:
        contracts: Contracts that hold together.
        assume: As for `compose`, for the machine with the newcomer.
        name: Which one is exchanged.
        changed: The newcomer.

    Returns:
        The contracts, all others untouched, or a failure where the newcomer breaks the standing promise.

    Raises:
        KeyError: no subsystem of that name.
    """
    promises = {key: contract.promise for key, contract in contracts.items()}
    needed = assume(promises)
    for key, contract in contracts.items():
        if key != name and not covers(contract.bounds, needed[key]):
            return Failure(reason=f"{name} changes what {key} was proved under: compose the network anew")
    made = prove(name, changed, needed[name])
    if isinstance(made, Failure):
        return made
    standing = promises[name]
    if not standing.holds(made.reached):
        return Failure(
            reason=f"{name} needs {made.reached.position:.4g} and has promised {standing.position:.4g} (speed "
            f"{made.reached.speed:.4g} of {standing.speed:.4g}, acceleration {made.reached.acceleration:.4g} of "
            f"{standing.acceleration:.4g}): compose the network anew"
        )
    return {**contracts, name: replace(made, promise=standing)}


def prove(name: str, own: Subsystem, bounds: Bounds) -> Contract | Failure:
    """One subsystem under given assumptions."""
    found = certify_sampled(own.model, bounds, own.gains, own.limit)
    if isinstance(found, Failure):
        return replace(found, reason=f"{name}: {found.reason}")
    rows = deviation_rows(own.model, bounds, own.gains, found.radii, found.held)
    reached = Tube(
        position=float(found.radii[0]), speed=float(found.radii[1]),
        acceleration=float(speeds(rows, found, bounds.period)[1]),
    )  # fmt: skip
    return Contract(promise=reached.scaled(ROOM), reached=reached, bounds=bounds, certificate=found)


def covers(assumed: Bounds, needed: Bounds) -> bool:
    """Whether disturbances and measurement errors are inside the assumed ones."""
    pushed = all(
        assumed.disturbances[key].low <= value.low and value.high <= assumed.disturbances[key].high
        for key, value in needed.disturbances.items()
    )
    return pushed and all(a >= b for a, b in zip(assumed.noise, needed.noise, strict=True))


def _sizes(bounds: Bounds) -> Array:
    return np.array([*(value.magnitude for value in bounds.disturbances.values()), *bounds.noise])


def _ahead(have: Array, want: Array, gap: Array | None) -> Array:
    """Where assumptions that grow geometrically will settle, judged by how the gap has shrunk."""
    if gap is None or not (gap > 0).any():
        return want
    left = np.maximum(want - have, 0.0)
    ratio = float(np.max(np.divide(left, gap, out=np.zeros_like(gap), where=gap > 0)))
    return want + left * (ratio / (1 - ratio) * TRUSTED if ratio < STEEPEST else 0.0)


def _grown(assumed: Bounds, needed: Bounds, factors: Array) -> Bounds:
    count = len(needed.disturbances)
    disturbances = {
        key: _hull(assumed.disturbances[key], value + Interval.symmetric((float(factor) - 1) * value.magnitude))
        for (key, value), factor in zip(needed.disturbances.items(), factors[:count], strict=True)
    }
    noise = tuple(max(a, b * float(f)) for a, b, f in zip(assumed.noise, needed.noise, factors[count:], strict=True))
    return replace(needed, disturbances=disturbances, noise=noise)


def _hull(a: Interval, b: Interval) -> Interval:
    return Interval(min(a.low, b.low), max(a.high, b.high))


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

    def assume(promises: Mapping[str, Tube]) -> dict[str, Bounds]:
        found = dict(alone)
        for coupling in couplings:
            push = Interval.symmetric(coupling.gain * promises[coupling.source].position * (1 + 1e-12))
            bounds = found[coupling.target]
            disturbances = dict(bounds.disturbances)
            disturbances[coupling.disturbance] = disturbances[coupling.disturbance] + push
            found[coupling.target] = replace(bounds, disturbances=disturbances)
        return found

    return assume
