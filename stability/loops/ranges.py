"""Rows of numbers that are known between two."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..enclosures.interval import Interval

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Range:
    """A row between two. Shape (k,)."""

    low: Array
    high: Array

    @classmethod
    def of(cls, row: Array) -> Range:
        """One row."""
        return cls(row, row)

    @property
    def middle(self) -> Array:
        """Between both ends."""
        return (self.low + self.high) / 2

    @property
    def radius(self) -> Array:
        """How far an end is from there."""
        return (self.high - self.low) / 2

    def __add__(self, other: Range) -> Range:
        return Range(self.low + other.low, self.high + other.high)

    def times(self, factor: Interval) -> Range:
        """With a number between two."""
        ends = [end * f for end in (self.low, self.high) for f in (factor.low, factor.high)]
        return Range(np.min(ends, axis=0), np.max(ends, axis=0))
