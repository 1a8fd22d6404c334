"""Golden vectors: inputs and outputs of one control period, so that a port can be tested."""

from __future__ import annotations

from typing import Any

import numpy as np

from ..control.law import step_function
from ..problem import GainSet
from ..simulation import Loop, scenarios

#: Vectors of each member.
COUNT = 24


def golden_vectors(loop: Loop, gains: GainSet) -> dict[str, list[dict[str, Any]]]:
    """Vectors of each member's law along the first scenario of the study."""
    problem = loop.problem
    trace = loop.trace(gains, scenarios(problem)[0])
    shared, n = loop.batches.shared(), len(problem.members)
    found = {}
    for k, member in enumerate(problem.members):
        own, law = trace.members[member.name], step_function(member.law, member.bounds.period)
        nominal = list(member.plant.values().values())
        vectors = []
        for tick in np.linspace(0, trace.t.size - 1, COUNT).astype(int):
            x, r, z = own.x[:, tick], own.r[:, tick], own.z[:, tick]
            foreseen = [shared[tick, 4 * n + k]] if problem.foreseeing else []
            load = foreseen or [member.bounds.nominal[name] for name in member.plant.disturbances]
            u, following, _ = law(x, r, z, list(gains[member.name]), nominal, load)
            ends = np.cumsum([len(member.model.controlled)] * 2)
            theta, phi, lead = np.split(z, ends)
            theta_next, phi_next, lead_next = np.split(np.array(following).ravel(), ends)
            entry = {"x": x, "r": r, "theta": theta, "phi": phi, "u": np.array(u).ravel(), "theta_next": theta_next,
                     "phi_next": phi_next}  # fmt: skip
            if lead.size:
                entry |= {"lead": lead, "lead_next": lead_next}
            if foreseen:
                entry["load"] = np.array(foreseen)
            vectors.append({key: [float(v) for v in values] for key, values in entry.items()})
        found[member.name] = vectors
    return found
