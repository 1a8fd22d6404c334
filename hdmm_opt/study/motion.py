"""Studies of a motion alone: a machine, moves to make, and how the motion is chosen; no controller."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field, model_validator

from ..machines.crane_dynamics import JOINTS
from ..machines.crane_limits import COSTS, LEAST_LEVER, joint_limits
from .messages import refused
from .sections import NonNegative, Pair, Positive, Section, StudySection

Triple = tuple[float, float, float]


class CraneSection(Section):
    """The crane; its geometry, masses and drives are those of `machines/crane*.py`."""

    model: Literal["crane"]
    least_lever_m_rad: Annotated[float, Field(gt=0, le=0.25)] = LEAST_LEVER


class PlaceSection(Section):
    """A place of the tool, or joint coordinates."""

    tool_m: Pair | None = None
    joints_rad_rad_m: Triple | None = None

    @model_validator(mode="after")
    def _one_goal(self) -> PlaceSection:
        if (self.tool_m is None) == (self.joints_rad_rad_m is None):
            raise refused("", "needs either tool_m or joints_rad_rad_m", "give one of the two")
        return self


class MoveSection(PlaceSection):
    """A move to a place, by way of others that are passed without a stop."""

    via: Annotated[tuple[PlaceSection, ...], Field(max_length=30)] = ()
    payload_kg: NonNegative = 0.0


Sizes = tuple[Positive, Positive, Positive]


class LimitsSection(Section):
    """Limits of a motion; what a study leaves out is the crane's. Of the three joints: lift, tilt, telescope."""

    speed_rad_rad_m_s: Sizes | None = None
    acceleration_rad_rad_m_s2: Sizes | None = None
    jerk_rad_rad_m_s3: Sizes | None = None
    rod_force_n: Positive | None = None
    motor_speed_rad_s: Positive | None = None
    motor_torque_nm: Positive | None = None
    current_a: Positive | None = None
    voltage_v: Positive | None = None
    tool_speed_m_s: Positive | None = None
    tool_acceleration_m_s2: Positive | None = None


class ObstacleSection(Section):
    """A ball, or a half-space beyond a wall, that the tool keeps clear of."""

    name: Annotated[str, Field(min_length=1, max_length=64)]
    centre_m: Pair | None = None
    radius_m: Positive | None = None
    normal: Pair | None = None
    offset_m: float | None = None

    @model_validator(mode="after")
    def _one_kind(self) -> ObstacleSection:
        ball, wall = (self.centre_m, self.radius_m), (self.normal, self.offset_m)
        for given, other in ((ball, wall), (wall, ball)):
            if None not in given and other == (None, None):
                break
        else:
            raise refused("", "needs either centre_m and radius_m, or normal and offset_m", "give one of the two pairs")
        if self.normal is not None and not abs(self.normal[0] ** 2 + self.normal[1] ** 2 - 1) < 1e-6:
            raise refused("normal", f"must have length 1: got {list(self.normal)}", "divide it by its length")
        return self


class CostSection(Section):
    """Weights of the cost: duration [1/s], squared jerk, electrical energy and its losses [1/J], effort [1/s]."""

    time: NonNegative = 1.0
    jerk: NonNegative = 0.0
    energy: NonNegative = 0.0
    loss: NonNegative = 0.0
    effort: NonNegative = 0.0

    @model_validator(mode="after")
    def _some(self) -> CostSection:
        if not any(getattr(self, name) for name in ("time", "jerk", *COSTS)):
            raise refused("", "needs one weight above zero: got none", "give time a weight")
        return self


class JobSection(Section):
    """The moves, and how their motions are chosen: a spline program, or a leader and a follower."""

    kind: Literal["bspline", "bilevel"]
    start_rad_rad_m: Triple
    longest_s: Positive = 60.0
    spans: Annotated[int, Field(ge=6, le=200)] = 24
    limits: LimitsSection = LimitsSection()
    cost: CostSection | None = None
    evaluations: Annotated[int, Field(ge=2, le=10_000)] | None = None
    moves: Annotated[tuple[MoveSection, ...], Field(min_length=1, max_length=10)]
    obstacles: Annotated[tuple[ObstacleSection, ...], Field(max_length=20)] = ()

    @model_validator(mode="after")
    def _fitting(self) -> JobSection:
        if self.kind == "bilevel" and (self.cost is not None or any(move.via for move in self.moves)):
            raise refused("", 'has no cost and no via with kind = "bilevel"', 'remove them, or use kind = "bspline"')
        if self.kind == "bspline" and self.evaluations is not None:
            raise refused("evaluations", 'has no place with kind = "bspline"', "remove it")
        return self


class MotionStudy(Section):
    """A whole file of this kind."""

    study: StudySection
    plant: CraneSection
    reference: JobSection

    @model_validator(mode="after")
    def _inside(self) -> MotionStudy:
        low_ends, high_ends = joint_limits(self.plant.least_lever_m_rad).room
        given = [("start_rad_rad_m", self.reference.start_rad_rad_m)]
        given += [
            (f"moves.{k}.joints_rad_rad_m", move.joints_rad_rad_m)
            for k, move in enumerate(self.reference.moves)
            if move.joints_rad_rad_m is not None
        ]
        given += [
            (f"moves.{k}.via.{j}.joints_rad_rad_m", place.joints_rad_rad_m)
            for k, move in enumerate(self.reference.moves)
            for j, place in enumerate(move.via)
            if place.joints_rad_rad_m is not None
        ]
        for key, place in given:
            for name, value, low, high in zip(JOINTS, place, low_ends, high_ends, strict=True):
                if not low <= value <= high:
                    rule = f"must keep the {name} between {low:.4g} and {high:.4g}: got {value:g}"
                    raise refused(f"reference.{key}", rule, "move the place, or allow a shorter lever")
        return self
