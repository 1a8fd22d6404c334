"""The machine of a study, and what is uncertain about it."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field, model_validator

from ..errors import RefusedKeyError
from ..machines.registry import model
from .messages import refused, refused_together
from .sections import LimitSection, Name, NonNegative, Pair, ParameterSection, Positive, Section


class NumberSection(Section):
    """Numbers of an actuator by name; and the range of its first state, the unit in the key."""

    parameters: dict[str, ParameterSection] = Field(default_factory=dict)
    ratings: dict[str, LimitSection] = Field(default_factory=dict)
    limits: dict[str, LimitSection] = Field(default_factory=dict)
    stroke_m: Pair | None = None
    stroke_rad: Pair | None = None
    stroke_m_s: Pair | None = None
    stroke_rad_s: Pair | None = None


class DriveSection(NumberSection):
    """The numbers of one member, and how weak its actuator may become.

    `bundled` names what a study left to the bundled machine; a gain file says so.
    """

    least_effectiveness: Annotated[float, Field(ge=0, le=1)] | None = None
    bundled: tuple[str, ...] | None = None


class PlantSection(NumberSection):
    """The machine by name, and its numbers where they are not the bundled ones."""

    model: str
    level: str | None = None
    sensor: str | None = None
    urdf: str | None = None
    tip_m: tuple[float, float, float] | None = None
    damping: NonNegative | None = None
    least_lever_m_rad: Annotated[float, Field(gt=0, le=0.25)] | None = None
    joints: dict[Name, DriveSection] = Field(default_factory=dict)
    locked: dict[Name, float] = Field(default_factory=dict)
    body: dict[str, ParameterSection] = Field(default_factory=dict)
    shared: dict[str, LimitSection] = Field(default_factory=dict)

    @model_validator(mode="after")
    def _fitting(self) -> PlantSection:
        try:
            found = list(model(self.model).check(self))
        except RefusedKeyError as error:
            found = [error]
        refused_together(found)
        return self


class DisturbanceSection(Section):
    """The range of something from outside; constant in a run, or of any course, at any rate or at a bounded one."""

    range: Pair
    rate: Positive | None = None
    course: Literal["constant", "any"] | None = None
    unit: str | None = None

    @model_validator(mode="after")
    def _ordered(self) -> DisturbanceSection:
        low, high = self.range
        if low > high:
            raise refused("range", f"needs lower <= upper: got [{low:g}, {high:g}]", "swap or correct them")
        return self


class UncertaintySection(Section):
    """What the proof covers besides parameter tolerances: disturbances, measurement errors, initial errors.

    A measurement may be wrong by its noise and by half of the step in which the sensor counts.
    """

    disturbances: dict[Name, DisturbanceSection] = Field(default_factory=dict)
    noise: dict[str, NonNegative] = Field(default_factory=dict)
    resolution: dict[str, NonNegative] = Field(default_factory=dict)
    initial: dict[str, NonNegative] = Field(default_factory=dict)
