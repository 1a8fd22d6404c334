"""Studies of a motion alone: a machine, places to go, and how the motion is chosen; no controller."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field, model_validator

from .bilevel import Job
from .crane_task import joint_limits
from .plants.crane_dynamics import JOINTS
from .study import NonNegative, Pair, Positive, Section, StudySection


class CraneSection(Section):
    """The crane; its geometry, masses and drives are those of `plants/crane*.py`."""

    model: Literal["crane"]
    least_lever_m_rad: Annotated[float, Field(gt=0, le=0.25)] = 0.08


class MoveSection(Section):
    """A move of the tool to a place."""

    tool_m: Pair
    payload_kg: NonNegative = 0.0


class JobSection(Section):
    """Where the tool goes, and how much the leader tries."""

    kind: Literal["bilevel"]
    start_rad_rad_m: tuple[float, float, float]
    longest_s: Positive = 60.0
    evaluations: Annotated[int, Field(ge=2, le=10_000)] = 24
    moves: Annotated[tuple[MoveSection, ...], Field(min_length=1, max_length=10)]


class MotionStudy(Section):
    """A whole file of this kind."""

    study: StudySection
    plant: CraneSection
    reference: JobSection

    @model_validator(mode="after")
    def _inside(self) -> MotionStudy:
        low_ends, high_ends = joint_limits(self.plant.least_lever_m_rad).room
        for name, value, low, high in zip(JOINTS, self.reference.start_rad_rad_m, low_ends, high_ends, strict=True):
            if not low <= value <= high:
                raise ValueError(
                    f"|reference.start_rad_rad_m|must keep the {name} between {low:.4g} and {high:.4g}: "
                    f"got {value:g}|move the start, or allow a shorter lever"
                )
        return self

    def job(self) -> Job:
        """The job of the leader and the follower."""
        return Job(
            start=self.reference.start_rad_rad_m,
            places=tuple(move.tool_m for move in self.reference.moves),
            payloads=tuple(move.payload_kg for move in self.reference.moves),
            longest=self.reference.longest_s,
            least_lever=self.plant.least_lever_m_rad,
        )
