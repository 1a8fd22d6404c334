"""The law of a study, and how its gains are searched."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field, model_validator

from .messages import refused
from .sections import GainSection, Name, NonNegative, Pair, Positive, Section

Rate = Annotated[float, Field(gt=0, le=1e5)]


class ObserverSection(Section):
    """A motion-state observer for every member: position is measured, speed is not (P-4).

    Without a bandwidth the speed is the difference of two measurements.
    """

    bandwidth_rad_s: Positive | None = None


class MonitorSection(Section):
    """What shuts every actuator down: a measured error of a first state, in its unit, or a signal out of a range.

    The ranges stand by the names of the plant's limits; they are of what is commanded, and of states as they are
    estimated.
    """

    error: Positive
    limits: dict[Name, Pair] = Field(default_factory=dict)

    @model_validator(mode="after")
    def _ordered(self) -> MonitorSection:
        for name, (low, high) in self.limits.items():
            if not low < high:
                raise refused(f"limits.{name}", f"needs lower < upper: got [{low:g}, {high:g}]", "swap or correct them")
        return self


class ControllerSection(Section):
    """The law of every member, its rate and gains; `members` and `rates_hz` hold what differs from one to another.

    `delay_s` is the time from a measurement until the input that is made of it acts, `jitter_s` how much earlier or
    later it may.
    """

    law: Annotated[str, Field(pattern="^[a-z][a-z0-9_]*$", max_length=40)]
    modelling: tuple[Literal["mechanics", "friction", "resistance", "back_emf", "decoupling", "flow"], ...] = ()
    rate_hz: Rate
    rates_hz: dict[Name, Rate] = Field(default_factory=dict)
    delay_s: NonNegative = 0.0
    jitter_s: NonNegative = 0.0
    gains: dict[str, GainSection] = Field(default_factory=dict)
    members: dict[Name, dict[str, GainSection]] = Field(default_factory=dict)
    observer: ObserverSection | None = None
    monitor: MonitorSection | None = None

    def rate_of(self, member: str) -> float:
        """Control rate of a member, Hz."""
        return self.rates_hz.get(member, self.rate_hz)


class WeightSection(Section):
    """Weights of the closed-loop cost."""

    rms_error: NonNegative = 1.0
    certified_bound: NonNegative = 1.0
    itae: NonNegative = 0.2
    effort: NonNegative = 0.2

    @model_validator(mode="after")
    def _some(self) -> WeightSection:
        if not self.rms_error + self.certified_bound + self.itae + self.effort > 0:
            rule = "needs one weight above zero: got none"
            raise refused("", rule, "give rms_error or certified_bound a weight")
        return self


class TuningSection(Section):
    """Search budget of the second stage."""

    method: Literal["jaya", "tlbo", "random", "gradient"] = "jaya"
    population: Annotated[int, Field(ge=4, le=500)] = 20
    iterations: Annotated[int, Field(ge=0, le=10_000)] = 20
    seconds: Positive | None = None
    seed: Annotated[int, Field(ge=0)] = 1
    weights: WeightSection = WeightSection()
