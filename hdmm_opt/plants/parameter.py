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
    """

    value: float
    unit: str
    tolerance: float = 0.0
    source: str = "assumed"
    meaning: str = ""
