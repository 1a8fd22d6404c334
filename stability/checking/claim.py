"""The statement about one member as data."""

from __future__ import annotations

from dataclasses import dataclass, field
from fractions import Fraction
from typing import Any

from .arithmetic import Interval
from .limits import MAX_BLOCK, MAX_GROUP, MAX_GROUPS, MAX_ORDER, need
from .parsing import index, number, numbers


@dataclass(frozen=True)
class Gain:
    """Gains of one controlled row and times of its leads, as intervals; bound and start of its network, as numbers."""

    beta: Interval
    epsilon: Interval
    delta: Interval
    sigma: Interval
    gamma: Interval
    lead: Interval
    smooth: Interval
    capacity: Fraction
    preload: Fraction


@dataclass(frozen=True)
class Cell:
    """What a file says of the loop for a part of the ranges: middles of J and B, coordinates, groups, weight."""

    force: list[list[Fraction]]
    drive: list[list[Fraction]]
    columns: list[list[Fraction]]
    blocks: list[int]
    groups: list[int]
    growth: Fraction


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
    delay: Fraction
    gains: list[tuple[Fraction, ...]]
    split: list[int]
    cells: list[Cell]
    half_widths: list[Fraction]
    input_bound: list[Fraction]
    demand: list[Interval]
    middle: list[Fraction]
    network_bound: list[Fraction]
    ultimate: list[Fraction]
    limits: list[dict[str, Any]]
    stroke: Interval
    accuracy: Fraction
    transient: Fraction
    feedforward: dict[str, tuple[Interval, Interval]] = field(default_factory=dict)
    first: str = "position"
    rest: tuple[Fraction, Fraction] = (Fraction(0), Fraction(0))
    observer: tuple[Fraction, ...] = ()
    jitter: Fraction = Fraction(0)
    shown: list[Fraction] = field(default_factory=list)
    leads: int = 0
    parts: dict[str, int] = field(default_factory=dict)
    lags: list[int] = field(default_factory=list)

    @property
    def measured(self) -> list[Fraction]:
        """Bounds on the errors of what the controller knows of the states: measured, or by an observer."""
        return [*self.shown[:2], *self.noise[2:]] if self.observer else self.noise

    @property
    def controlled(self) -> list[int]:
        """Indices of the rows with gains."""
        return [i for i, row in enumerate(self.rows) if row["controlled"]]

    @property
    def networks(self) -> list[int]:
        """Indices of the rows with a load network."""
        return [i for i, gain in zip(self.controlled, self.gains, strict=True) if gain[4] > 0]

    def places_of_leads(self, row: int) -> list[int]:
        """Which of all sections of lead act on the error of a row; those of an input stand together."""
        if row not in self.input_map:
            return []
        first = self.leads * self.input_map.index(row)
        return list(range(first, first + self.leads))

    @property
    def whole(self) -> int:
        """Whole periods of the computing delay."""
        return int(self.delay / self.period)

    @property
    def share(self) -> Fraction:
        """The rest of the delay as a share of the period."""
        return self.delay / self.period - self.whole

    @property
    def pending(self) -> int:
        """Samples whose inputs are still to act."""
        return self.whole + (self.share > 0 or self.jitter > 0)


def cell_of(entry: dict[str, Any], middle: dict[str, Any], n: int, m: int) -> Cell:
    """One cell of a certificate of n rows and m inputs; how large it must be is decided where the loop is built.

    The middles of J and B are in `middle`, an entry that all cells may share.
    """
    columns = entry["columns"]
    need(isinstance(columns, list) and 1 <= len(columns) <= MAX_ORDER, f"coordinates are of 1 to {MAX_ORDER} states")
    blocks = [index(v, MAX_BLOCK + 1, "a block") for v in entry["blocks"]]
    need(min(blocks) >= 1 and sum(blocks) == len(columns), "the blocks do not cover the coordinates")
    groups = [index(v, MAX_GROUP + 1, "a group of periods") for v in entry["groups"]]
    need(1 <= len(groups) <= MAX_GROUPS and min(groups) >= 1, f"1 to {MAX_GROUPS} groups of periods are summed")
    growth = number(entry["growth"], "growth")
    need(growth >= 1, "the weight of a period is 1 or more")
    force, drive = (
        [numbers(row, size, key) for row in listed_of(middle[key], n, key)]
        for key, size in (("force", n), ("drive", m))
    )
    return Cell(force, drive, [numbers(row, len(columns), "coordinates") for row in columns], blocks, groups, growth)


def listed_of(value: Any, count: int, what: str) -> list[Any]:
    """A list of a given length."""
    need(isinstance(value, list) and len(value) == count, f"{what} must have {count} rows")
    return value
