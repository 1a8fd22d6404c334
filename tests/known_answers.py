"""Loops with known answers, shared by the tests of the verifier."""

from fractions import Fraction
from typing import Any

import casadi as ca
import numpy as np

from stability import (
    Bounds,
    Composition,
    Failure,
    Gains,
    Impulse,
    Interval,
    LoopModel,
    Observer,
    Row,
    certify,
    certify_impulse,
    checker,
    from_casadi,
)
from stability.checker import Cell, Claim

#: Theory §3: |w| of the oracle loops, m/s².
DISTURBANCE = 0.816

#: (ω_1, ω_2) -> exact worst case, composition bound, its μ; adversary and composition with g in ±20 %; all in mm.
ORACLE_ROWS = {
    (15, 100): (0.544, 0.595, 0.680, 0.765),
    (10, 60): (1.360, 1.505, 1.700, 1.945),
    (20, 80): (0.510, 0.606, 0.640, 0.811),
}


def integrator_chain(order: int, *, unit: float = 1.0) -> LoopModel:
    """x_1' = x_2, x_2' = g x_3 + w, x_3' = u (u takes the place of the next state in shorter chains; a single row is
    x_1' = g u + w), with the RAC law in every row; lengths in multiples of 1/unit m.
    """
    states = tuple(f"x{i + 1}" for i in range(order))
    names = (*states, "u", "g", "w")
    z = ca.SX.sym("z", len(names))
    gain, disturbance = z[order + 1], unit * z[order + 2]
    following = [z[i + 1] for i in range(order)]
    hit = 0 if order == 1 else 1
    force = [gain * f + disturbance if i == hit else f for i, f in enumerate(following)]
    plant = from_casadi(ca.Function("plant", [z], [ca.vertcat(*[1.0] * order, *force)]), names)
    y = ca.SX.sym("y", order + 1)
    term = from_casadi(ca.Function("term", [y], [ca.SX(0)]), (*states, "r1"))
    rows = tuple(
        Row(state=s, unit="m", target="reference" if i == 0 else i - 1, controlled=True) for i, s in enumerate(states)
    )
    return LoopModel(rows=rows, input_map=(order - 1,), inputs=("u",), plant=plant, law=(term,) * order)


def chain_bounds(
    order: int,
    *,
    spread: float = 0.0,
    period: float = 0.0,
    unit: float = 1.0,
    disturbance: float = DISTURBANCE,
    delay: float = 0.0,
    observer: Observer | None = None,
) -> Bounds:
    """Constant reference, no noise, |w| <= disturbance, g in 1 ± spread."""
    return Bounds(
        parameters={"g": Interval(1 - spread, 1 + spread)},
        disturbances={"w": Interval(-disturbance, disturbance)},
        nominal={},
        reference=(Interval(0.0),) * 4,
        noise=(0.0,) * order,
        initial=(0.0,) * order,
        period=period,
        delay=delay,
        observer=observer,
    )


def certify_chain(bandwidths: tuple[float, ...], **assumed: Any) -> Composition | Failure:
    """Certificate of an integrator chain with bandwidths ω_i = β_i / 2."""
    order, unit = len(bandwidths), assumed.get("unit", 1.0)
    limit = unit * np.array([0.05, 1.0, 100.0])[:order]
    gains = tuple(Gains(beta=2.0 * w) for w in bandwidths)
    return certify(integrator_chain(order, unit=unit), chain_bounds(order, **assumed), gains, limit)


def certify_impulse_chain(bandwidths: tuple[float, ...], *, refine: bool = False, **assumed: Any) -> Impulse | Failure:
    """The same by its impulse responses."""
    order, unit = len(bandwidths), assumed.get("unit", 1.0)
    limit = unit * np.array([0.05, 1.0, 100.0])[:order]
    gains = tuple(Gains(beta=2.0 * w) for w in bandwidths)
    return certify_impulse(
        integrator_chain(order, unit=unit), chain_bounds(order, **assumed), gains, limit, refine=refine
    )


def fraction(value: float, digits: int = 9) -> Fraction:
    """A short rational near a float."""
    return Fraction(f"{value:.{digits - 1}e}")


def claim_of(
    model: LoopModel, bounds: Bounds, gains: tuple[Gains, ...], found: Impulse, *, accuracy: float = 1e3,
    limit: float = 1e9,
) -> Claim:  # fmt: skip
    """What the checker would read from a file about this certificate; generous limits."""

    def pair(interval: Interval) -> tuple[Fraction, Fraction]:
        return Fraction(interval.low), Fraction(interval.high)

    def program(expression: object) -> dict[str, object]:
        data = expression.to_data()  # type: ignore[attr-defined]
        return {"operations": data["operations"], "outputs": data["outputs"]}

    rows = model.to_data()["rows"]
    for row in rows:
        if isinstance(row["target"], dict):
            row["target"] = {name: Fraction(share) for name, share in row["target"].items()}
    return Claim(
        name="",
        rows=rows,
        input_map=list(model.input_map),
        inputs=list(model.inputs),
        plant=program(model.plant),
        law=[program(term) for term in model.law],
        parameters={name: pair(i) for name, i in bounds.parameters.items()},
        disturbances={name: pair(i) for name, i in bounds.disturbances.items()},
        nominal={name: Fraction(value) for name, value in bounds.nominal.items()},
        reference=[pair(i) for i in bounds.reference],
        noise=[Fraction(v) for v in bounds.noise],
        initial=[Fraction(v) for v in bounds.initial],
        period=Fraction(bounds.period),
        delay=Fraction(bounds.delay),
        gains=[
            tuple(
                Fraction(v)
                for v in (g.beta, g.epsilon, g.delta, g.sigma, g.gamma, g.capacity, g.preload, g.lead, g.smooth)
            )
            for g in gains
        ],
        split=list(found.partition.split),
        leads=model.leads,
        parts=dict(found.partition.parts),
        lags=[next(i for i, row in enumerate(model.rows) if row.state == name) for name in found.lags],
        cells=[
            Cell(
                [[fraction(v) for v in row] for row in c.force],
                [[fraction(v) for v in row] for row in c.drive],
                [[fraction(v, 17) for v in row] for row in c.columns],
                list(c.blocks),
                list(c.groups),
                fraction(c.growth),
            )
            for c in found.cells
        ],
        half_widths=[fraction(v) for v in found.half_widths],
        input_bound=[fraction(v) for v in found.input_bound],
        demand=[(fraction(a), fraction(b)) for a, b in zip(found.box.low, found.box.high, strict=True)],
        middle=[fraction(v) for v in found.box.middle],
        network_bound=[fraction(v) for v in found.box.network_bound],
        ultimate=[fraction(v * (1 + 5e-4)) for v in found.ultimate],
        limits=[{"name": "input", "signals": list(model.inputs), "value": Fraction(limit), "unit": "1"}],
        stroke=(Fraction(-(10**12)), Fraction(10**12)),
        accuracy=Fraction(accuracy),
        transient=Fraction(bounds.transient),
        rest=(Fraction(bounds.rest[0]), Fraction(bounds.rest[1])),
        feedforward={name: (pair(v), pair(rate)) for name, (v, rate) in bounds.feedforward.items()},
        jitter=Fraction(bounds.jitter),
        observer=() if bounds.observer is None else (Fraction(bounds.observer.first), Fraction(bounds.observer.second)),
        shown=[fraction(v) for v in found.box.shown],
    )


def verdict(claim: Claim, *, larger: bool = False) -> bool:
    """True where the checker proves every obligation; with `larger` also where it says that it takes on no such size."""
    checker.WORK.begin(checker.MAX_PRODUCTS)
    try:
        return all(o.verdict == "proved" for o in checker.obligations(claim)[0])
    except checker.NotProvedError as refusal:
        return larger and "larger than this checker takes on" in str(refusal)
