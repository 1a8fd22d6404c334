"""What the rows of a model are beyond their operations: a position and its rate, a chain to it, whole limits.

Must fail: a second state that is not the first one's rate, a row that nothing depends on, a limit that leaves out a
state of its unit, golden vectors that test nothing.
"""

from __future__ import annotations

from typing import Any

from .claim import Claim
from .limits import need
from .parsing import reads


def well_formed(claim: Claim) -> None:
    """Refuse a model whose states are not what their names, units and limits say."""
    _kinematic(claim)
    _connected(claim)
    units = {row["state"]: row["unit"] for row in claim.rows}
    for limit in claim.limits[1:]:
        alike = {state for state, unit in units.items() if unit == limit["unit"]}
        limited = {
            signal for other in claim.limits[1:] if other["unit"] == limit["unit"] for signal in other["signals"]
        }
        need(limited == alike, f"the limits in {limit['unit']} must be about every state in {limit['unit']}")


def _kinematic(claim: Claim) -> None:
    """The second state is the rate of a first position, and the law knows that of the reference."""
    if claim.first == "speed" or len(claim.rows) == 1:
        return
    operations, outputs = claim.plant["operations"], claim.plant["outputs"]
    one = operations[outputs[0]][0] == "const" and float(operations[outputs[0]][1]) == 1.0
    kinematic = operations[outputs[len(claim.rows)]] == ["input", claim.rows[1]["state"]]
    need(kinematic and one, f"{claim.name}: the first state's rate is not the second state")
    need(claim.rows[1]["target"] == 0, f"{claim.name}: the second state does not follow the first")
    term = claim.law[0]
    rate = term["operations"][term["outputs"][0]] == ["input", "r1"]
    need(rate, f"{claim.name}: the first modelling term is not the reference's rate")


def _connected(claim: Claim) -> None:
    """Every state moves the first one, by way of others or itself."""
    n, states = len(claim.rows), [row["state"] for row in claim.rows]
    read = [reads(claim.plant, [claim.plant["outputs"][n + i]]) for i in range(n)]
    reached, fresh = {0}, [0]
    while fresh:
        row = fresh.pop()
        more = [j for j in range(n) if states[j] in read[row] and j not in reached]
        reached.update(more)
        fresh += more
    lost = [states[j] for j in range(n) if j not in reached]
    need(not lost, f"nothing depends on the state {', '.join(lost)}")


def different(vectors: list[dict[str, Any]], claim: Claim) -> None:
    """Refuse golden vectors that repeat each other in what the law reads, or that never move a result."""
    named = {name for term in claim.law for name in reads(term)} | {"r0"}
    kept = [k for k in range(4) if f"r{k}" in named]
    seen = {
        (tuple(v["x"]), tuple(v["r"][k] for k in kept), tuple(v["theta"]), tuple(v["phi"]), tuple(v.get("lead", ())))
        for v in vectors
    }
    need(len(seen) == len(vectors), "golden vectors must differ in what the law reads")
    need(len({tuple(v["u"]) for v in vectors}) > len(vectors) // 2, "golden vectors must move the input")
