"""Where a tool may not be: half-spaces and balls."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

#: Length over which the tip of a ball's distance is rounded off, m.
ROUNDED = 1e-6


@dataclass(frozen=True, kw_only=True)
class HalfSpace:
    """The points p with normal · p > offset are forbidden.

    Attributes:
        name: What stands there, such as "ground".
        normal: Unit vector into the forbidden side. Shape (d,).
        offset: Distance of the wall from the origin along the normal, m.
    """

    name: str
    normal: tuple[float, ...]
    offset: float

    def __post_init__(self) -> None:
        object.__setattr__(self, "normal", tuple(float(n) for n in self.normal))
        if not abs(sum(n**2 for n in self.normal) - 1) < 1e-6:
            raise ValueError(f"a normal has length 1: got {self.normal} for {self.name}; divide it by its length")

    def clearance(self, point: Any) -> Any:
        """Distance to the wall, m; negative beyond it. Symbols or numbers, shape (d,)."""
        return self.offset - sum(n * point[i] for i, n in enumerate(self.normal))


@dataclass(frozen=True, kw_only=True)
class Ball:
    """The points nearer than a radius to a centre are forbidden.

    Attributes:
        name: What stands there.
        centre: Centre, m. Shape (d,).
        radius: Radius, m, > 0.
    """

    name: str
    centre: tuple[float, ...]
    radius: float

    def __post_init__(self) -> None:
        object.__setattr__(self, "centre", tuple(float(c) for c in self.centre))
        if not self.radius > 0:
            raise ValueError(f"a ball needs a positive radius: got {self.radius} m for {self.name}")

    def clearance(self, point: Any) -> Any:
        """Distance to the surface, m, negative inside; smooth at the centre too, where it is off by `ROUNDED`."""
        squared = sum((point[i] - c) ** 2 for i, c in enumerate(self.centre))
        # both roots are shifted alike: the zero stays exactly at the surface
        return (squared + ROUNDED**2) ** 0.5 - (self.radius**2 + ROUNDED**2) ** 0.5


Obstacle = HalfSpace | Ball
