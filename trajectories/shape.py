"""Where the control points, durations and slacks of a motion stand in the vector of variables."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


@dataclass(frozen=True, kw_only=True)
class Shape:
    """Where things stand in the vector of variables: phase by phase its control points and its duration, then slacks.

    Attributes:
        count: Coordinates n.
        controls: Control points k of a phase.
        phases: Phases.
        slacks: Slacks.
    """

    count: int
    controls: int
    phases: int
    slacks: int = 0

    @property
    def block(self) -> int:
        """Variables of a phase."""
        return self.controls * self.count + 1

    @property
    def size(self) -> int:
        """Variables in all."""
        return self.phases * self.block + self.slacks

    def place(self, phase: int, control: Any, coordinate: Any) -> Any:
        """Index of a coordinate of a control point."""
        return phase * self.block + control * self.count + coordinate

    def duration(self, phase: int) -> int:
        """Index of a phase's duration."""
        return (phase + 1) * self.block - 1

    def packed(self, points: list[Array], durations: Array) -> Array:
        """The vector of variables of control points, each shape (k, n), and durations; slacks 0."""
        parts = [np.append(p.ravel(), t) for p, t in zip(points, durations, strict=True)]
        return np.concatenate([*parts, np.zeros(self.slacks)])

    def unpacked(self, x: Array) -> tuple[list[Array], Array]:
        """Control points and durations of the phases."""
        blocks = x[: self.phases * self.block].reshape(self.phases, self.block)
        return [block[:-1].reshape(self.controls, self.count) for block in blocks], blocks[:, -1]
