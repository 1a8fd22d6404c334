"""Modular proofs: many loops that push each other, each proved against what its neighbours guarantee.

Every member guarantees a tube: bounds on its deviations of position, speed and acceleration for all t. It is proved
with what the neighbours' guarantees make of its disturbances and of its measurement errors. Where all proofs hold
together no guarantee can be the first to be broken; they are found as the fixed point of "guarantees -> assumptions ->
proofs -> guarantees". A member that is replaced is proved anew against the standing assumptions; if it keeps its own
guarantee, no other proof changes. A member that nothing links needs no guarantee, and any kind of certificate will do.

References:
    Siljak (1978), Large-Scale Dynamic Systems, ch. 2, for comparison systems of interconnections.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from ..certificates.certificate import Failure
from ..certificates.impulse import Impulse, Search, begun, certify_impulse
from ..enclosures.interval import Interval
from ..loops.model import Bounds, Gains, LoopModel
from .coupling import Tube

Array = NDArray[np.float64]

#: A guarantee is this much wider than what is needed, so that a subsystem may change a little without breaking it.
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
        gains: One for each controlled row.
        limit: Largest admissible box, |z_i| <= limit_i. Shape (n,).
        first: Whether its first state is a position or a speed.
    """

    model: LoopModel
    gains: tuple[Gains, ...]
    limit: Array
    first: str = "position"


@dataclass(frozen=True, kw_only=True)
class Contract:
    """A member's guarantee, and its proof against the guarantees of its neighbours.

    Attributes:
        guarantee: What holds for all t; None for a member that nothing links.
        reached: What the certificate gives, inside the guarantee; None where there is none.
        bounds: The assumptions of the proof, neighbours included.
        certificate: The certificate; `checker.py` decides it.
    """

    guarantee: Tube | None
    reached: Tube | None
    bounds: Bounds
    certificate: Impulse


#: From the guarantees to the assumptions that each member is proved under.
Assume = Callable[[Mapping[str, Tube]], Mapping[str, Bounds]]


def solve_contracts(
    subsystems: Mapping[str, Subsystem], assume: Assume, *, fine: bool = False
) -> dict[str, Contract] | Failure:
    """Contracts that hold together.

    Args:
        subsystems: The loops by name.
        assume: What the guarantees of all make of each one's disturbances and measurement errors; wider guarantees must
            give wider assumptions.
        fine: Cut the ranges of the inertias; tighter, and slower.

    Returns:
        A contract for each member, or why there are none. The work grows linearly with their number.
    """
    nothing = Tube(position=0.0, speed=0.0, acceleration=0.0)
    assumed = dict(assume(dict.fromkeys(subsystems, nothing)))
    gap: Array | None = None
    searches: dict[str, Search | Failure] = {}
    for turn in range(ROUNDS):
        made: dict[str, Contract] = {}
        for name, own in subsystems.items():
            if name not in searches:
                searches[name] = begun(own.model, assumed[name], own.gains, own.limit, fine=fine)
            found = _proved(name, own, assumed[name], searches[name])
            if isinstance(found, Failure):
                return replace(found, together=turn > 0)
            made[name] = found
        needed = assume(guarantees(made))
        if all(covers(assumed[name], needed[name]) for name in subsystems):
            return made
        have, want = (np.concatenate([_sizes(part[name]) for name in subsystems]) for part in (assumed, needed))
        target, gap = _ahead(have, want, gap), np.maximum(want - have, 0.0)
        grown = np.divide(target, want, out=np.ones_like(want), where=want > 0)
        for name in subsystems:
            count = len(_sizes(needed[name]))
            assumed[name] = _grown(assumed[name], needed[name], WIDENING * grown[:count])
            grown = grown[count:]
    reason = f"the guarantees did not settle in {ROUNDS} rounds: the couplings are too strong"
    return Failure(reason=reason, together=True)


def replaced(
    contracts: Mapping[str, Contract], assume: Assume, name: str, changed: Subsystem
) -> dict[str, Contract] | Failure:
    """Put another member in the place of one; only its own proof is made anew.

    Args:
        contracts: Contracts that hold together.
        assume: As for `solve_contracts`, for the machine with the candidate.
        name: Which one is replaced.
        changed: The candidate.

    Returns:
        The contracts, all others untouched, or a failure where the candidate breaks the standing guarantee.

    Raises:
        KeyError: no member of that name.
    """
    standing = guarantees(contracts)
    needed = assume(standing)
    for key, contract in contracts.items():
        if key != name and not covers(contract.bounds, needed[key]):
            return Failure(reason=f"{name} changes what {key} was proved under: design the machine anew")
    made = prove(name, changed, needed[name])
    if isinstance(made, Failure):
        return made
    told, reached = standing[name], made.reached
    assert reached is not None
    if not told.holds(reached):
        return Failure(
            reason=f"{name} needs {reached.position:.4g} and has guaranteed {told.position:.4g} (speed "
            f"{reached.speed:.4g} of {told.speed:.4g}, acceleration {reached.acceleration:.4g} of "
            f"{told.acceleration:.4g}): design the machine anew"
        )
    return {**contracts, name: replace(made, guarantee=told)}


def prove(name: str, own: Subsystem, bounds: Bounds) -> Contract | Failure:
    """One member under given assumptions, with the tube that it can guarantee."""
    return _contract(name, own, bounds, certify_impulse(own.model, bounds, own.gains, own.limit))


def _proved(name: str, own: Subsystem, bounds: Bounds, search: Search | Failure) -> Contract | Failure:
    return _contract(name, own, bounds, search if isinstance(search, Failure) else search.run(bounds))


def _contract(name: str, own: Subsystem, bounds: Bounds, found: Impulse | Failure) -> Contract | Failure:
    if isinstance(found, Failure):
        return replace(found, reason=f"{name}: {found.reason}")
    reached = tube_of(own, found)
    return Contract(guarantee=reached.scaled(ROOM), reached=reached, bounds=bounds, certificate=found)


def tube_of(own: Subsystem, found: Impulse) -> Tube:
    """The deviations that a certificate bounds for all t."""
    if own.first == "speed":
        return Tube(position=0.0, speed=float(found.half_widths[0]), acceleration=float(found.rates[0]))
    return Tube(
        position=float(found.half_widths[0]), speed=float(found.half_widths[1]), acceleration=float(found.rates[1])
    )


def guarantees(contracts: Mapping[str, Contract]) -> dict[str, Tube]:
    """The guarantees by member.

    Raises:
        ValueError: a member that guarantees nothing.
    """
    found = {}
    for name, contract in contracts.items():
        if contract.guarantee is None:
            raise ValueError(f"{name} guarantees nothing: its proof is of a member that nothing links")
        found[name] = contract.guarantee
    return found


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
    # what has room stays: an error that nothing makes larger is that of the sensor
    noise = tuple(
        a if a >= b else b * float(f) for a, b, f in zip(assumed.noise, needed.noise, factors[count:], strict=True)
    )
    return replace(needed, disturbances=disturbances, noise=noise)


def _hull(a: Interval, b: Interval) -> Interval:
    return Interval(min(a.low, b.low), max(a.high, b.high))
