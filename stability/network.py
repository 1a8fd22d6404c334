"""Modular proofs: many loops that push each other, each proved against what its neighbours promise.

Every subsystem promises ``|z_1(t)| <= R_i`` for all t, and is proved with the neighbours' promises as part of its
disturbance, ``|w| <= own + sum_j γ_ij R_j``. Where all proofs hold together no promise can be the first to be broken.
The promises come from the comparison system ``R = r + ΓR``: a solution exists where the Metzler matrix ``Γ - I`` is
Hurwitz (Siljak 1978, ch. 2). A subsystem that is exchanged is proved anew against the standing promises; if it keeps
its own, no other proof changes.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from .certificate import Failure
from .interval import Interval
from .model import Bounds, Gains, LoopModel
from .sampled import Sampled, certify_sampled

Array = NDArray[np.float64]

#: A promise is this much wider than what is needed, so that a subsystem may change a little without breaking it.
ROOM = 1.05
ROUNDS = 6


@dataclass(frozen=True, kw_only=True)
class Subsystem:
    """One loop.

    Attributes:
        model: Plant and law.
        bounds: Assumptions, without the neighbours.
        gains: One for each governed row.
        limit: Largest admissible box, |z_i| <= limit_i. Shape (n,).
    """

    model: LoopModel
    bounds: Bounds
    gains: tuple[Gains, ...]
    limit: Array


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


@dataclass(frozen=True, kw_only=True)
class Contract:
    """A subsystem's promise, and its proof against the promises of its neighbours.

    Attributes:
        promise: Bound on |z_1(t)| for all t.
        bounds: The assumptions of the proof, neighbours included.
        certificate: The certificate; `checker.py` decides it.
    """

    promise: float
    bounds: Bounds
    certificate: Sampled

    @property
    def reached(self) -> float:
        """The bound on |z_1(t)| for all t that the certificate gives."""
        return float(self.certificate.radii[0])


def compose(subsystems: Mapping[str, Subsystem], couplings: Sequence[Coupling]) -> dict[str, Contract] | Failure:
    """Contracts that hold together.

    Args:
        subsystems: The loops by name.
        couplings: Who pushes whom.

    Returns:
        A contract for each subsystem, or why there are none. The work grows linearly with their number, but for one
        linear system of equations.

    Raises:
        KeyError: a coupling names an unknown subsystem or disturbance.
    """
    names = list(subsystems)
    first = _prove_all(subsystems, couplings, dict.fromkeys(names, 0.0))
    if isinstance(first, Failure):
        return first
    alone = {name: contract.reached for name, contract in first.items()}
    promises = alone
    for _ in range(ROUNDS):
        contracts = _prove_all(subsystems, couplings, promises)
        if isinstance(contracts, Failure):
            return contracts
        if all(contract.reached <= contract.promise for contract in contracts.values()):
            return contracts
        pushed = {name: contract.reached for name, contract in contracts.items()}
        found = _promises(names, couplings, alone, promises, pushed)
        if found is None:
            return Failure(reason="the couplings are too strong: the comparison matrix of the network is not Hurwitz")
        promises = found
    return Failure(reason=f"the promises did not settle in {ROUNDS} rounds")


def exchange(
    contracts: Mapping[str, Contract], couplings: Sequence[Coupling], name: str, changed: Subsystem
) -> dict[str, Contract] | Failure:
    """Put another subsystem in the place of one; only its own proof is made anew.

    Returns:
        The contracts, all others untouched, or a failure where the newcomer breaks the standing promise.

    Raises:
        KeyError: no subsystem of that name.
    """
    made = _prove(name, changed, couplings, {key: contract.promise for key, contract in contracts.items()})
    if isinstance(made, Failure):
        return made
    if not made.reached <= made.promise:
        return Failure(
            reason=f"{name} needs {made.reached:.4g} and has promised {made.promise:.4g}: compose the network anew"
        )
    return {**contracts, name: made}


def _assumed(name: str, bounds: Bounds, couplings: Sequence[Coupling], promises: Mapping[str, float]) -> Bounds:
    disturbances = dict(bounds.disturbances)
    for coupling in couplings:
        if coupling.target == name:
            push = Interval.symmetric(coupling.gain * promises[coupling.source] * (1 + 1e-12))
            disturbances[coupling.disturbance] = disturbances[coupling.disturbance] + push
    return replace(bounds, disturbances=disturbances)


def _prove(
    name: str, own: Subsystem, couplings: Sequence[Coupling], promises: Mapping[str, float]
) -> Contract | Failure:
    bounds = _assumed(name, own.bounds, couplings, promises)
    found = certify_sampled(own.model, bounds, own.gains, own.limit)
    if isinstance(found, Failure):
        return replace(found, reason=f"{name}: {found.reason}")
    return Contract(promise=promises[name], bounds=bounds, certificate=found)


def _prove_all(
    subsystems: Mapping[str, Subsystem], couplings: Sequence[Coupling], promises: Mapping[str, float]
) -> dict[str, Contract] | Failure:
    made: dict[str, Contract] = {}
    for name, own in subsystems.items():
        found = _prove(name, own, couplings, promises)
        if isinstance(found, Failure):
            return found
        made[name] = found
    return made


def _promises(
    names: list[str], couplings: Sequence[Coupling], alone: Mapping[str, float], assumed: Mapping[str, float],
    pushed: Mapping[str, float],
) -> dict[str, float] | None:  # fmt: skip
    """Solve R = r + ΓR, where Γ is read off what the neighbours' promises cost each subsystem."""
    index = {name: i for i, name in enumerate(names)}
    weight = np.zeros((len(names),) * 2)
    for coupling in couplings:
        weight[index[coupling.target], index[coupling.source]] += coupling.gain
    level = np.array([assumed[name] for name in names])
    cost = np.array([pushed[name] - alone[name] for name in names])
    total = weight @ level
    gamma = weight * np.divide(cost, total, out=np.zeros_like(cost), where=total > 0)[:, None]
    if not float(np.max(np.abs(np.linalg.eigvals(gamma)))) < 1 / ROOM:
        return None
    solution = np.linalg.solve(np.eye(len(names)) - ROOM * gamma, ROOM * np.array([alone[name] for name in names]))
    return dict(zip(names, solution.tolist(), strict=True))
