"""The motion to follow."""

from __future__ import annotations

import math
from itertools import pairwise
from typing import Annotated, Literal

from pydantic import Field, model_validator

from .messages import refused
from .sections import SPANS, NonNegative, Places, Positive, Section

#: An entry for each member.
Sizes = Annotated[tuple[Positive, ...], Field(min_length=1, max_length=16)]


class MotionLimitSection(Section):
    """Limits of the reference: of one actuator with units in the keys, of an arm with an entry for each joint."""

    speed_m_s: Positive | None = None
    acceleration_m_s2: Positive | None = None
    jerk_m_s3: Positive | None = None
    speed: Sizes | None = None
    acceleration: Sizes | None = None
    jerk: Sizes | None = None
    torque_nm: Positive | None = None
    current_a: Positive | None = None
    voltage_v: Positive | None = None

    @property
    def single(self) -> tuple[float, float, float]:
        """Largest speed, acceleration and jerk of one actuator; infinite where none is given."""
        speed, acceleration, jerk = (
            math.inf if size is None else size for size in (self.speed_m_s, self.acceleration_m_s2, self.jerk_m_s3)
        )
        return speed, acceleration, jerk


class ReferenceSection(Section):
    """Rest-to-rest moves of all members through waypoints, with a dwell before, between and after.

    `coordinates` says whose the waypoints are: of the joints of a machine, or of its members, as gain files have them.
    """

    kind: Literal["quintic", "bspline"]
    waypoints: Annotated[Places, Field(min_length=2, max_length=50)]
    coordinates: Literal["joints", "members"] = "joints"
    durations_s: Annotated[tuple[Positive, ...], Field(max_length=49)] = ()
    dwell_s: NonNegative = 0.5
    objective: Literal["time", "energy"] = "time"
    pace: Annotated[float, Field(gt=0, le=1)] = 1.0
    jerk_weight: NonNegative = 0.05
    longest_s: Positive = 60.0
    spans: Annotated[int, Field(ge=6, le=200)] = SPANS
    limits: MotionLimitSection | None = None

    @model_validator(mode="after")
    def _complete(self) -> ReferenceSection:
        moves = len(self.waypoints) - 1
        if len({len(place) for place in self.waypoints}) > 1:
            raise refused("waypoints", "must all have one entry for each member", "complete them")
        timed = self.kind == "quintic" or self.objective == "energy"
        if timed and len(self.durations_s) != moves:
            raise refused(
                "durations_s", f"must give one duration for each of the {moves} moves: got {len(self.durations_s)}",
                'list them, or use kind = "bspline" with objective = "time"',
            )  # fmt: skip
        if not timed and self.durations_s:
            raise refused("durations_s", "has no place in a minimum-time motion", "remove it; pace makes it slower")
        if any(a == b for a, b in pairwise(self.waypoints)):
            raise refused("waypoints", "must differ from one to the next", "use dwell_s for a pause")
        return self
