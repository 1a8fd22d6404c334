"""What sections of a study file are made of."""

from __future__ import annotations

from typing import Annotated, Any, Literal

from pydantic import BaseModel, BeforeValidator, ConfigDict, Field, model_validator

from .messages import refused

Positive = Annotated[float, Field(gt=0)]
NonNegative = Annotated[float, Field(ge=0)]
Share = Annotated[float, Field(ge=-1, le=1)]
Pair = tuple[float, float]
Name = Annotated[str, Field(pattern=r"^[A-Za-z][A-Za-z0-9_]{0,31}$")]
#: A name, or that of a member with a dot before it.
Owned = Annotated[str, Field(pattern=r"^([A-Za-z][A-Za-z0-9_]{0,31}\.)?[A-Za-z][A-Za-z0-9_]{0,31}$")]

#: Spans of a motion of one phase where a study gives none.
SPANS = 36
#: No quantity of these machines is larger in SI units.
LARGEST = 1e12


class Section(BaseModel):
    """A section of a study file: unknown keys and infinite numbers are errors."""

    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False, strict=False)


class StudySection(Section):
    """Name of the study and what it is about."""

    name: Annotated[str, Field(pattern=r"^[A-Za-z0-9][A-Za-z0-9_-]{0,63}$")]
    publication: str = ""
    summary: str = ""


class ParameterSection(Section):
    """One plant parameter."""

    value: float
    unit: str
    tolerance: Annotated[float, Field(ge=0, lt=1)] | None = None
    source: Literal["table", "derived", "public", "assumed"]
    meaning: str | None = None


class LimitSection(Section):
    """One limit of a plant."""

    value: Positive
    unit: str
    source: Literal["table", "derived", "public", "assumed"]


class GainSection(Section):
    """A gain: fixed by `value`, or searched between `min` and `max`."""

    value: float | None = None
    min: Positive | None = None
    max: Positive | None = None

    @model_validator(mode="after")
    def _one_way(self) -> GainSection:
        if (self.value is None) == (self.min is None or self.max is None):
            raise refused("", "needs either value, or min and max", "give one of the two")
        if self.value is not None and (self.min is not None or self.max is not None):
            raise refused("", "needs either value, or min and max: got both", "remove one")
        if self.min is not None and self.max is not None:
            ordered("", (self.min, self.max))
        return self


def ordered(name: str, pair: Pair) -> None:
    """Refuse a range that is upside down or empty."""
    low, high = pair
    if low > high:
        raise refused(name, f"needs lower <= upper: got [{low:g}, {high:g}]", "swap or correct them")
    if low == high:
        raise refused(name, f"is an empty range: got [{low:g}, {high:g}]", "widen it, or fix the value")


def _listed(value: Any) -> Any:
    """Numbers of one member stand for lists of one."""
    if isinstance(value, list | tuple):
        return [[entry] if isinstance(entry, int | float) else entry for entry in value]
    return value


#: Places of all members; with one member a place may be a number.
Places = Annotated[tuple[tuple[float, ...], ...], BeforeValidator(_listed)]
