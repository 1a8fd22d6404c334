"""Plant parameters with unit, tolerance and source."""

from __future__ import annotations

from dataclasses import dataclass

#: Where a value comes from: the dissertation's tables, arithmetic on them, another public source, or a placeholder.
SOURCES = ("table", "derived", "public", "assumed")


@dataclass(frozen=True, kw_only=True)
class Parameter:
    """One number of a plant.

    Attributes:
        value: Nominal value, [unit].
        unit: SI unit, "1" for none.
        tolerance: Relative half width of the range that the proof covers; constant in time.
        source: One of `SOURCES`. An "assumed" value is a placeholder that the user must replace.
        meaning: One line.
        loss: Whether it is a loss, which a machine may be without: zero is a value.
        ends: The range itself where it is not symmetric or where its ends are to be met exactly.
    """

    value: float
    unit: str
    tolerance: float = 0.0
    source: str = "assumed"
    meaning: str = ""
    loss: bool = False
    ends: tuple[float, float] | None = None

    def at(self, share: float) -> float:
        """The value at a place in the tolerance, -1 … 1."""
        return self.value * (1 + self.tolerance * share)


#: The parameter that a degraded actuator lowers, in the plants that have it.
EFFECTIVENESS = "effectiveness"


def effectiveness(least: float) -> Parameter:
    """An actuator that delivers between a least share of what is commanded and all of it, at any time."""
    middle = (1 + least) / 2
    return Parameter(
        value=middle, unit="1", tolerance=1 - least / middle, source="derived" if least == 1 else "assumed",
        meaning="share of the commanded torque that is delivered", ends=(least, 1.0),
    )  # fmt: skip


def healthy(parameter: Parameter) -> float:
    """The place of full effectiveness in the tolerance of that parameter, -1 … 1."""
    spread = parameter.value * parameter.tolerance
    return 0.0 if spread == 0 else (1.0 - parameter.value) / spread
