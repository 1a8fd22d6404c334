"""The job that a study of a motion alone stands for, and its motions."""

from __future__ import annotations

import math
from collections.abc import Callable

from trajectories import Ball, HalfSpace, Obstacle

from ..study.motion import LimitsSection, MotionStudy, ObstacleSection
from .crane_task import Bounded, crane_cost
from .sequence import Job, Motions, Move, carried_out
from .two_level import bilevel

#: Decisions of the leader where a study gives none.
EVALUATIONS = 24


def job_of(study: MotionStudy) -> Job:
    """The moves to make."""
    section = study.reference
    return Job(
        start=section.start_rad_rad_m,
        moves=tuple(
            Move(
                tool=m.tool_m,
                joints=m.joints_rad_rad_m,
                payload=m.payload_kg,
                via=tuple(p.joints_rad_rad_m or p.tool_m or () for p in m.via),
            )
            for m in section.moves
        ),
        obstacles=tuple(_obstacle(entry) for entry in section.obstacles),
        longest=section.longest_s,
        least_lever=study.plant.least_lever_m_rad,
        bounds=_bounds(section.limits),
    )


def _bounds(limits: LimitsSection) -> Bounded:
    drives = {
        "force": limits.rod_force_n, "motor speed": limits.motor_speed_rad_s, "motor torque": limits.motor_torque_nm,
        "current": limits.current_a, "voltage": limits.voltage_v,
    }  # fmt: skip
    tool = (limits.tool_speed_m_s, limits.tool_acceleration_m_s2)
    return Bounded(
        speed=limits.speed_rad_rad_m_s, acceleration=limits.acceleration_rad_rad_m_s2, jerk=limits.jerk_rad_rad_m_s3,
        drives=tuple((name, value) for name, value in drives.items() if value is not None),
        tool=(tool[0] or math.inf, tool[1] or math.inf),
    )  # fmt: skip


def _obstacle(section: ObstacleSection) -> Obstacle:
    if section.centre_m is not None and section.radius_m is not None:
        return Ball(name=section.name, centre=section.centre_m, radius=section.radius_m)
    assert section.normal is not None and section.offset_m is not None
    return HalfSpace(name=section.name, normal=section.normal, offset=section.offset_m)


def motions_of(study: MotionStudy, progress: Callable[[float, str], None]) -> tuple[Motions, ...]:
    """The motions by the study's kind of reference.

    Raises:
        LimitViolatedError: a move that no motion inside the limits makes.
    """
    section = study.reference
    if section.kind == "bilevel":
        budget = section.evaluations or EVALUATIONS
        return bilevel(
            job_of(study), budget, lambda done, best: progress(done / budget, f"lost {best:.4g} J"),
            spans=section.spans,
        ).ways  # fmt: skip
    weights = {"time": 1.0} if section.cost is None else section.cost.model_dump()
    found = carried_out(
        job_of(study), lambda payload: crane_cost(payload=payload, **weights), "spline program", spans=section.spans
    )
    return (found,)
