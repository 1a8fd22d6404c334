"""Golden vectors follow from the gains and the law, to float accuracy."""

from __future__ import annotations

import math
from typing import Any

from .arithmetic import WORK
from .claim import Claim
from .forms import walk
from .limits import need
from .parsing import numbers


def golden_agree(vectors: Any, claim: Claim) -> bool:
    """The recorded input/output vectors follow from the gains and the law, to float accuracy."""
    need(isinstance(vectors, list) and 20 <= len(vectors) <= 100, "golden must hold 20 to 100 vectors")
    WORK.one(len(vectors) * sum(len(term["operations"]) for term in claim.law) // 8)
    pairs = [_golden_one(vector, claim) for vector in vectors]
    for column in zip(*pairs, strict=True):
        size = max((abs(found) for found, _ in column), default=0.0)
        if not all(math.isfinite(a) and abs(a - float(b)) <= SHARE * size + TINIEST for a, b in column):
            return False
    return True


#: Agreement that is asked for, as a share of the largest value of a component, and of values that are all zero.
SHARE, TINIEST = 1e-9, 1e-300


def _golden_one(vector: dict[str, Any], claim: Claim) -> list[tuple[float, Any]]:
    """What follows and what is recorded, for every component."""
    n, k = len(claim.rows), len(claim.controlled)
    x, r, theta, phi = (
        [float(v) for v in numbers(vector[key], count, "golden")]
        for key, count in (("x", n), ("r", 4), ("theta", k), ("phi", k))
    )
    named = {row["state"]: value for row, value in zip(claim.rows, x, strict=True)}
    named |= {f"r{j}": value for j, value in enumerate(r)}
    named |= {f"nominal.{name}": float(value) for name, value in claim.nominal.items()}
    known = [name for name in claim.feedforward if name not in claim.nominal]
    foreseen = numbers(vector.get("load", []), len(known), "golden")
    named |= {f"nominal.{name}": float(value) for name, value in zip(known, foreseen, strict=True)}
    remembered = [float(v) for v in numbers(vector.get("lead", []), claim.leads * len(claim.inputs), "golden")]
    period, led = float(claim.period), list(remembered)
    virtual: dict[int, float] = {}
    following, errors = [], []
    for j, i in enumerate(claim.controlled):
        target = claim.rows[i]["target"]
        goal = r[0] if target == "reference" else 0.0 if target == "zero" else virtual[target]
        beta, epsilon, delta, sigma, *_, lead, smooth = (float(g) for g in claim.gains[j])
        error, program = x[i] - goal, claim.law[j]
        term = walk(program, named.__getitem__, float, float_apply)[program["outputs"][0]]
        acting = error
        for place in claim.places_of_leads(i):
            w, every = remembered[place], smooth + period
            led[place] = (smooth * w + period * acting) / every
            acting = ((lead + period) * acting + (smooth - lead) * w) / every
        virtual[i] = -(beta + epsilon * theta[j]) * acting / 2 + term - phi[j]
        errors.append(error)
        step = epsilon * delta * error * error / 2 - delta * sigma * theta[j]
        following.append(theta[j] + period * step)
    asked = [virtual[row] for row in claim.input_map]
    norm, limit = math.hypot(*asked), float(claim.limits[0]["value"])
    wanted = [value * (limit / max(norm, limit)) for value in asked]
    learned = []
    for j, i in enumerate(claim.controlled):
        gamma, capacity, own = float(claim.gains[j][4]), float(claim.gains[j][5]), _input_of(claim, i)
        held = abs(asked[own]) > abs(wanted[own]) and -errors[j] * asked[own] > 0
        step = 0.0 if held else period * gamma * errors[j]
        learned.append(min(max(phi[j] + step, -capacity), capacity))
    pairs = list(zip(wanted, numbers(vector["u"], len(wanted), "golden"), strict=True))
    pairs += zip(following, numbers(vector["theta_next"], k, "golden"), strict=True)
    pairs += zip(learned, numbers(vector["phi_next"], k, "golden"), strict=True)
    pairs += zip(led, numbers(vector.get("lead_next", []), len(led), "golden"), strict=True)
    return pairs


def _input_of(claim: Claim, row: int) -> int:
    """The input at the end of the chain that a row begins."""
    following = next((j for j in claim.controlled if claim.rows[j]["target"] == row), None)
    return claim.input_map.index(row) if following is None else _input_of(claim, following)


def float_apply(operator: str, a: float, b: float = 0.0) -> float:
    """Operations in floats."""
    simple = {"add": a + b, "sub": a - b, "mul": a * b, "neg": -a, "sq": a * a, "max": max(a, b)}
    if operator in simple:
        return simple[operator]
    if operator in ("sin", "cos"):
        return math.sin(a) if operator == "sin" else math.cos(a)
    return a / b if operator == "div" else math.tanh(a) if operator == "tanh" else math.sqrt(a)
