"""The job that a study of a motion alone stands for, and its motions."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

from trajectories import Ball, HalfSpace, Obstacle

from ..machines.registry import model
from ..study.motion import LimitsSection, MotionStudy, MoveSection, ObstacleSection, PlaceSection
from ..study.sections import SPANS
from .arm_mover import arm_mover
from .crane_task import crane_mover
from .job import Job, Move, Place
from .mover import Bounded, Mover
from .sequence import Motions, carried_out
from .two_level import bilevel

#: Decisions of the leader where a study gives none.
EVALUATIONS = 24
#: What the kinds of motion are called.
NAMES = {"bspline": "spline program", "toppra": "TOPP-RA", "ruckig": "Ruckig"}


def job_of(study: MotionStudy) -> Job:
    """The moves to make."""
    section = study.reference
    return Job(
        mover=_mover(study), start=section.start, speed=section.start_speed, acceleration=section.start_acceleration,
        moves=tuple(_move(move) for move in section.moves),
        obstacles=tuple(_obstacle(entry) for entry in section.obstacles),
        longest=section.longest_s, bounds=_bounds(section.limits),
    )  # fmt: skip


def _mover(study: MotionStudy) -> Mover:
    section = study.plant
    if section.model == "crane":
        return crane_mover() if section.least_lever_m_rad is None else crane_mover(section.least_lever_m_rad)
    return arm_mover(model(section.model).build(section))


def _place(section: PlaceSection) -> dict[str, Any]:
    return {
        "tool": section.tool_m, "angle": section.angle_rad, "joints": section.joints,
        "tolerance": section.tolerance_m or 0.0, "angle_tolerance": section.angle_tolerance_rad or 0.0,
        "joint_tolerance": section.tolerances,
    }  # fmt: skip


def _move(section: MoveSection) -> Move:
    return Move(
        **_place(section), via=tuple(Place(**_place(place)) for place in section.via), path=section.path_m or (),
        speed=section.speed, payload=section.payload_kg,
    )  # fmt: skip


def _bounds(limits: LimitsSection) -> Bounded:
    drives = {
        "force": limits.rod_force_n, "motor speed": limits.motor_speed_rad_s, "motor torque": limits.motor_torque_nm,
        "current": limits.current_a, "voltage": limits.voltage_v,
    }  # fmt: skip
    tool = (limits.tool_speed_m_s, limits.tool_acceleration_m_s2)
    return Bounded(
        speed=limits.speed, acceleration=limits.acceleration, jerk=limits.jerk,
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
    section, job = study.reference, job_of(study)
    if section.kind == "bilevel":
        budget = section.evaluations or EVALUATIONS
        return bilevel(
            job, budget, lambda done, best: progress(done / budget, f"lost {best:.4g} J"), spans=section.spans or SPANS
        ).ways
    weights = {"time": 1.0} if section.cost is None else section.cost.model_dump()

    def done(number: int) -> None:
        progress(number / len(job.moves), f"move {number} of {len(job.moves)}")

    return (
        carried_out(
            job, lambda payload: job.mover.cost(payload=payload, **weights), NAMES[section.kind], kind=section.kind,
            spans=section.spans, tick=done,
        ),
    )  # fmt: skip
