"""The part of the unit cube of all gains that a search goes through."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..problem import Problem

Array = NDArray[np.float64]

#: A search over members that are linked goes this far from its start, as a share of the range of each gain on a
#: logarithmic scale: few points farther from a proved one are proved.
REACH = 0.1


@dataclass(frozen=True, kw_only=True)
class Window:
    """A box in the unit cube.

    Attributes:
        low: Lower corner. Shape (d,).
        high: Upper corner.
    """

    low: Array
    high: Array

    @staticmethod
    def around(problem: Problem, point: Array) -> Window:
        """Where the search of a problem goes from a point."""
        reach = REACH if problem.linked else 1.0
        return Window(low=np.clip(point - reach, 0.0, 1.0), high=np.clip(point + reach, 0.0, 1.0))

    def at(self, local: Array) -> Array:
        """The point of the cube for one of the window's own unit cube."""
        return self.low + np.asarray(local) * (self.high - self.low)

    def local(self, point: Array) -> Array:
        """The reverse."""
        return (point - self.low) / (self.high - self.low)
