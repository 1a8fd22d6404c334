"""The statement about one member as data."""

from __future__ import annotations

from dataclasses import dataclass, field
from fractions import Fraction
from typing import Any

from .arithmetic import Interval
from .limits import VECTORS, need
from .parsing import numbers


@dataclass(frozen=True)
class Gain:
    """Gains of one controlled row, as intervals."""

    beta: Interval
    epsilon: Interval
    delta: Interval
    sigma: Interval


@dataclass(frozen=True)
class Cell:
    """W, R, P and s of a sampled certificate for a part of the inertias' ranges."""

    transform: list[list[Fraction]]
    reach: list[Fraction]
    start: list[Fraction]
    shape: list[Fraction]


@dataclass(frozen=True)
class Claim:
    """Everything that the checker reads from a file."""

    name: str
    rows: list[dict[str, Any]]
    input_map: list[int]
    inputs: list[str]
    plant: dict[str, Any]
    law: list[dict[str, Any]]
    parameters: dict[str, Interval]
    disturbances: dict[str, Interval]
    nominal: dict[str, Fraction]
    reference: list[Interval]
    noise: list[Fraction]
    initial: list[Fraction]
    period: Fraction
    gains: list[tuple[Fraction, ...]]
    kind: str
    decay: Fraction
    vectors: dict[str, list[Fraction]]
    split: list[int]
    cells: list[Cell]
    half_widths: list[Fraction]
    input_bound: list[Fraction]
    ultimate: list[Fraction]
    limits: list[dict[str, Any]]
    stroke: Interval
    accuracy: Fraction
    transient: Fraction
    feedforward: dict[str, tuple[Interval, Interval]] = field(default_factory=dict)
    first: str = "position"

    @property
    def controlled(self) -> list[int]:
        """Indices of the rows with gains."""
        return [i for i, row in enumerate(self.rows) if row["controlled"]]

    @property
    def weights(self) -> list[Fraction]:
        """Weights w of a composition."""
        return self.vectors["weights"]

    @property
    def young(self) -> list[Fraction]:
        """Young's ν of a composition."""
        return self.vectors["young"]

    @property
    def leak(self) -> list[Fraction]:
        """The p = ε θ* of a composition."""
        return self.vectors["leak"]


def cell_of(entry: dict[str, Any], count: int) -> Cell:
    """One cell of a sampled certificate."""
    rows = entry["transform"]
    need(isinstance(rows, list) and len(rows) == count, f"a transform must have {count} rows")
    vectors = [numbers(entry[name], count, name) for name in VECTORS["sampled"]]
    transform = [numbers(row, count, "a transform") for row in rows]
    return Cell(transform, *vectors)
