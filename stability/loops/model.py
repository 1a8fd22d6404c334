"""What a proof is about: the plant and the law as data, the bounds assumed, and the gains."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

from ..enclosures.expression import Expression
from ..enclosures.interval import Interval
from .observer import Observer

#: The signal of a target that is one, and the derivatives of the reference that have a bounded rate.
CONSTANT, SIGNALS = "constant", ("r0", "r1", "r2")
#: What a mode tracks that carries what the only other row that reads it needs.
BALANCE = "balance"
#: What rows track that follow no other row, as sums of signals.
ALONE: Mapping[str, Mapping[str, float]] = {"reference": {"r0": 1.0}, "zero": {}}


def balance_of(state: str) -> str:
    """The signal that is the value of a state with which the row that reads it moves as is asked for."""
    return f"@{state}"


@dataclass(frozen=True, kw_only=True)
class Row:
    """One subsystem, with error Q = x - target.

    Attributes:
        state: Name of its state.
        unit: Unit of its state.
        target: "reference" (r0), "zero", the index of the row whose virtual control is the target, or, where the law
            does not act, coefficients of r0, r1, r2, "constant", "DISTURBANCE" and "DISTURBANCE/PARAMETER": their sum
            is the value of the state in the motion that is asked for. Or "balance": the value with which the only
            other row that reads the state moves as is asked for.
        controlled: True where the RAC law acts in this row; False for an actuator lag.
    """

    state: str
    unit: str
    target: str | int | Mapping[str, float]
    controlled: bool

    @property
    def place(self) -> Mapping[str, float]:
        """Coefficients of the signals whose sum is the target; none where a row follows another."""
        if isinstance(self.target, int):
            return {}
        if self.target == BALANCE:
            return {balance_of(self.state): 1.0}
        return ALONE[self.target] if isinstance(self.target, str) else self.target


@dataclass(frozen=True, kw_only=True)
class LoopModel:
    """Plant M_i x_i' = h_i and modelling terms m_i of the law, as operation lists.

    Attributes:
        rows: The subsystems; a row's target row comes before it.
        input_map: For each plant input, the row whose virtual control it is.
        inputs: Names of the plant inputs.
        plant: Outputs M_1…M_n (constant in time), h_1…h_n; inputs: states, plant inputs, parameters, disturbances.
        law: One modelling term m_i for each controlled row; inputs: states, r0…r3, ``nominal.NAME``.
        leads: Sections of lead between the error of an input's row and its proportional part.
    """

    rows: tuple[Row, ...]
    input_map: tuple[int, ...]
    inputs: tuple[str, ...]
    plant: Expression
    law: tuple[Expression, ...]
    leads: int = 0

    @property
    def controlled(self) -> tuple[int, ...]:
        """Indices of the rows that carry gains."""
        return tuple(i for i, row in enumerate(self.rows) if row.controlled)

    @cached_property
    def rings(self) -> bool:
        """Whether there is a mode that the law leaves to itself: states that follow no row and no law."""
        return any(row.place and not row.controlled for row in self.rows)

    @cached_property
    def balanced(self) -> Mapping[int, int]:
        """For each row whose target is a balance, the row that it balances."""
        return {i: self._balanced(i) for i, row in enumerate(self.rows) if row.target == BALANCE}

    def _balanced(self, i: int) -> int:
        """The only other row that reads the state of row i."""
        outputs = self.plant.outputs[len(self.rows) :]
        found = [j for j, own in enumerate(outputs) if j != i and self.rows[i].state in self.plant.reads(own)]
        if len(found) != 1:
            raise ValueError(
                f"a state balances the only other row that reads it: {len(found)} read {self.rows[i].state}"
            )
        return found[0]

    @cached_property
    def quotients(self) -> list[str]:
        """Names "DISTURBANCE/PARAMETER" in targets: the plant's divisions of both are these signals, too."""
        return sorted({name for row in self.rows for name in row.place if "/" in name})

    @cached_property
    def program(self) -> Expression:
        """The plant with its quotients as inputs of their own."""
        return self.plant.joined(self.quotients)

    @cached_property
    def driven(self) -> Mapping[int, int]:
        """For each controlled row the one that what carries out κ_i acts in; see `_driven`."""
        return {i: self._driven(i) for i in self.controlled}

    def _driven(self, i: int) -> int:
        """Row i, or where that does not read what carries out κ_i, the only one that does."""
        follower = next((row.state for row in self.rows if row.target == i), None)
        follower = self.inputs[self.input_map.index(i)] if follower is None else follower
        n = len(self.rows)
        reading = [
            j for j, row in enumerate(self.rows)
            if row.state != follower and follower in self.plant.reads(self.plant.outputs[n + j])
        ]  # fmt: skip
        return i if i in reading or len(reading) != 1 else reading[0]

    def to_data(self) -> dict[str, Any]:
        """The model as JSON data."""
        return {
            "rows": [
                {
                    "state": r.state,
                    "unit": r.unit,
                    "controlled": r.controlled,
                    "target": dict(r.target) if isinstance(r.target, Mapping) else r.target,
                }
                for r in self.rows
            ],
            "input_map": list(self.input_map),
            "inputs": list(self.inputs),
            "plant": self.plant.to_data(),
            "law": [term.to_data() for term in self.law],
            **({"leads": self.leads} if self.leads else {}),
        }


@dataclass(frozen=True, kw_only=True)
class Gains:
    """Gains of one controlled row.

    Attributes:
        beta: Proportional gain β > 0.
        epsilon: Adaptation gain ε ≥ 0; 0 switches the adaptation off.
        delta: Adaptation rate δ > 0.
        sigma: Leakage σ > 0.
        gamma: Gain γ ≥ 0 of the load network φ̂; 0 switches it off.
        capacity: Φ, what |φ̂| is kept below; above 0 where γ is.
        preload: φ̂ at the start.
        lead: Time a ≥ 0 of each section of lead (1 + a s)/(1 + f s), s; see `lead.py`.
        smooth: Time f ≥ 0 of their filters, s; a section with a = f changes nothing.
    """

    beta: float
    epsilon: float = 0.0
    delta: float = 1.0
    sigma: float = 1.0
    gamma: float = 0.0
    capacity: float = 0.0
    preload: float = 0.0
    lead: float = 0.0
    smooth: float = 0.0


@dataclass(frozen=True, kw_only=True)
class Bounds:
    """The assumptions of a proof.

    Attributes:
        parameters: Range of each plant parameter; constant in time.
        disturbances: Range of each disturbance; arbitrary in time.
        nominal: Value of each design constant ``nominal.NAME`` of the law.
        reference: Ranges of r0 (position) … r3 (jerk).
        noise: Bound on the measurement error of each row's state. Shape (n,).
        initial: Bound on each |Q_i(0)|. Shape (n,).
        period: Control period in s; 0 for a continuous law.
        transient: Time from which on the bound on the tracking error must hold, s.
        feedforward: Disturbances whose rate is bounded: range, and range of the rate. `disturbances` then holds what
            the real one may differ from that, of any course. The law foresees them as they move, ``nominal.NAME``,
            unless `nominal` has the name.
        delay: Computing delay in s: what is measured at t_k acts from t_k + delay on.
        jitter: How much earlier or later it may act, s; at most the delay, and less than half a period.
        rest: Where the reference rests at first, and for how long, s.
        observer: What makes the first two states of the first one's measurement; None where all are measured.
    """

    parameters: Mapping[str, Interval]
    disturbances: Mapping[str, Interval]
    nominal: Mapping[str, float]
    reference: tuple[Interval, Interval, Interval, Interval]
    noise: tuple[float, ...]
    initial: tuple[float, ...]
    period: float
    transient: float = 0.0
    feedforward: Mapping[str, tuple[Interval, Interval]] = field(default_factory=dict)
    delay: float = 0.0
    jitter: float = 0.0
    rest: tuple[float, float] = (0.0, 0.0)
    observer: Observer | None = None
