"""What a design must meet, and the runs that must agree with its proof."""

from __future__ import annotations

from collections.abc import Iterable
from itertools import pairwise
from typing import Annotated, Any, Literal

from pydantic import BeforeValidator, Field, model_validator

from .messages import refused
from .sections import Name, NonNegative, Owned, Pair, Positive, Section, Share

#: Names of runs that are not the study's.
RESERVED = ("worst-case", "witness")


class RequirementSection(Section):
    """What the design must meet in every run inside the assumptions.

    `tracking_error_m` is that of the output: the tool of a machine, the rod of one actuator. `member_error` is that of
    each member in its unit; the efforts hold for every member that has them. The output has settled when it stays
    inside `settling_band_m`, which is `tracking_error_m` where it is not given.
    """

    tracking_error_m: Positive
    member_error: dict[Name, Positive] = Field(default_factory=dict)
    settling_time_s: Positive | None = None
    settling_band_m: Positive | None = None
    peak_torque_nm: Positive | None = None
    rms_torque_nm: Positive | None = None
    peak_current_a: Positive | None = None
    rms_current_a: Positive | None = None
    peak_voltage_v: Positive | None = None

    @property
    def band(self) -> float:
        """The band in which the output has settled, m."""
        return self.tracking_error_m if self.settling_band_m is None else self.settling_band_m


class FaultSection(Section):
    """What goes wrong with a member: its actuator loses effectiveness, its sensor is wrong, or it is blocked."""

    share: Annotated[float, Field(ge=0, le=1)] = 0.0
    start_s: NonNegative
    rate_1_s: Positive = 1e3
    stuck: Annotated[tuple[float, ...], Field(max_length=2)] = ()
    kind: Literal["actuator", "bias", "noise", "frozen", "blocked"] = "actuator"
    size: float = 0.0

    @model_validator(mode="after")
    def _sized(self) -> FaultSection:
        if self.kind in ("bias", "noise", "blocked") and (self.size == 0 or (self.kind != "bias" and self.size < 0)):
            raise refused("size", f'of a fault of kind "{self.kind}" says how much: got {self.size:g}', "give it")
        return self


def _course(value: Any) -> Any:
    """A number stands for a value that does not change."""
    return [[0.0, value]] if isinstance(value, int | float) else value


#: Breakpoints (time in s, value), linear between them and constant outside; a number for a constant.
Course = Annotated[tuple[Pair, ...], BeforeValidator(_course), Field(min_length=1)]


class ScenarioSection(Section):
    """One simulated run."""

    name: Annotated[str, Field(pattern=r"^[a-z0-9][a-z0-9_-]{0,63}$")]
    disturbances: dict[Owned, Course] = Field(default_factory=dict)
    parameters: dict[str, Share] = Field(default_factory=dict)
    noise: Annotated[float, Field(ge=0, le=1)] = 0.0
    bias: Share = 0.0
    initial: Share = 0.0
    quantisation: Annotated[float, Field(ge=0, le=1)] = 0.0
    faults: dict[Name, FaultSection] = Field(default_factory=dict)
    ground: dict[Owned, Course] | None = None

    @model_validator(mode="after")
    def _times(self) -> ScenarioSection:
        given = [(f"disturbances.{name}", course) for name, course in self.disturbances.items()]
        given += [(f"ground.{name}", course) for name, course in (self.ground or {}).items()]
        for name, course in given:
            times = [t for t, _ in course]
            if times[0] < 0:
                raise refused(name, f"needs times from 0 on: got {times[0]:g}", "correct it")
            if any(b <= a for a, b in pairwise(times)):
                raise refused(name, "needs increasing times", "sort them")
        return self


class ValidationSection(Section):
    """Closed-loop runs after the proof."""

    transient_s: NonNegative = 1.0
    monte_carlo: Annotated[int, Field(ge=0, le=100_000)] = 200
    falsify: Annotated[int, Field(ge=0, le=1_000_000)] = 0
    worst_case: bool = True
    scenarios: Annotated[tuple[ScenarioSection, ...], Field(min_length=1)]


def check_names(names: Iterable[str]) -> None:
    """Refuse scenarios of one name, or with one that hdmm-opt uses itself."""
    listed = list(names)
    for name in listed:
        if listed.count(name) > 1 or name in RESERVED:
            reason = f"{name} twice" if listed.count(name) > 1 else f"{name}, which hdmm-opt uses itself"
            raise refused("validation.scenarios", f"needs names of its own: got {reason}", "rename that scenario")
