"""A job of a machine: moves one after the other, each with its payload."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from trajectories import MotionLimits, Obstacle, Quantities, Task, Waypoint

from ..errors import InvalidInputError
from ..study.sections import SPANS
from .crane_task import crane_mover
from .mover import Bounded, Mover

Array = NDArray[np.float64]

#: The fewest spans of a phase where there are many.
FEWEST = 8


def spans_of(phases: int) -> int:
    """Spans of a phase where a study gives none: fewer in each where there are many."""
    return max(FEWEST, round(SPANS / math.sqrt(phases)))


@dataclass(frozen=True, kw_only=True)
class Place:
    """A place to pass, of the tool or of the joints; all empty for one that the rest of a move gives.

    Attributes:
        tool: Place of the tool, m; the joints are free to share the way.
        angle: Angle of the tool there, rad, with `tool`; None leaves it free.
        joints: Joint coordinates, rad or m. Shape (n,).
        tolerance: How far the tool may be from its place, m: it stays in the cube that the ball of this radius holds.
        angle_tolerance: How far its angle may be from the given one, rad.
        joint_tolerance: How far each joint may be from its place. Shape (n,), or None for not at all.
    """

    tool: tuple[float, ...] | None = None
    angle: float | None = None
    joints: tuple[float, ...] | None = None
    tolerance: float = 0.0
    angle_tolerance: float = 0.0
    joint_tolerance: tuple[float, ...] | None = None

    @property
    def value(self) -> tuple[float, ...]:
        """Place of the tool and its angle, NaN where it is free."""
        return (*(self.tool or ()), math.nan if self.angle is None else self.angle)


@dataclass(frozen=True, kw_only=True)
class Move(Place):
    """A move to a place, given for the tool or for the joints, or along a path of the tool.

    Attributes:
        via: What it passes without a stop.
        path: Control points of a Bezier curve that the tool follows from where it is, within `tolerance`, m; with an
            `angle` the tool turns to it evenly along the curve, within `angle_tolerance`.
        speed: Speed of the joints at the end, rad/s or m/s; None for rest. With `joints` alone.
        payload: Mass at the tool, kg, beside the end mass.
    """

    via: tuple[Place, ...] = ()
    path: tuple[tuple[float, ...], ...] = ()
    speed: tuple[float, ...] | None = None
    payload: float = 0.0

    def __post_init__(self) -> None:
        if (self.tool is not None) + (self.joints is not None) + bool(self.path) != 1:
            raise InvalidInputError(
                "a move goes to a place of the tool, to joint coordinates or along a path: give one of the three"
            )


@dataclass(frozen=True)
class State:
    """Where the joints are, and how they move there; None for rest."""

    place: Array
    speed: Array | None = None
    acceleration: Array | None = None

    @property
    def waypoint(self) -> Waypoint:
        """The state as the start of a motion."""
        return Waypoint(value=self.place, speed=self.speed, acceleration=self.acceleration)


@dataclass(frozen=True, kw_only=True)
class Job:
    """Moves one after the other.

    Attributes:
        mover: The machine.
        start: Joint coordinates at the start, rad or m. Shape (n,).
        speed, acceleration: How the joints move there; None for rest. Shape (n,).
        moves: The moves.
        obstacles: What the tool keeps clear of.
        longest: Longest admissible duration of a move, s.
        bounds: Limits that the job has in place of the machine's, and those of the tool.
    """

    mover: Mover = field(default_factory=crane_mover)
    start: tuple[float, ...]
    speed: tuple[float, ...] | None = None
    acceleration: tuple[float, ...] | None = None
    moves: tuple[Move, ...]
    obstacles: tuple[Obstacle, ...] = ()
    longest: float = 60.0
    bounds: Bounded = field(default_factory=Bounded)

    @property
    def at(self) -> State:
        """Where it starts."""
        speed, acceleration = (None if v is None else np.array(v) for v in (self.speed, self.acceleration))
        return State(np.array(self.start), speed, acceleration)

    @cached_property
    def limits(self) -> MotionLimits:
        """Limits of the joints."""
        return self.bounds.of(self.mover.limits)

    def quantities(self, payload: float, *, jerk: bool = True) -> Quantities:
        """What is limited beside the joints."""
        return self.mover.quantities(payload, self.obstacles, self.bounds, jerk=jerk)

    def task(self, waypoints: tuple[Any, ...], payload: float, **options: Any) -> Task:
        """A move of the job as a task."""
        places = tuple(p if isinstance(p, Waypoint) else Waypoint(value=np.asarray(p, dtype=float)) for p in waypoints)
        return Task(
            waypoints=places,
            **{"limits": self.limits, "quantities": self.quantities(payload), "longest": self.longest, **options},
        )

    def near(self, value: Any, at: Array) -> Array:
        """Joint coordinates with the tool at a place (and an angle), near to given ones.

        Raises:
            LimitViolatedError: no posture was found. Not guaranteed: that there is none.
        """
        return self.mover.posture(value, at, self.limits)

    def waypoint(self, place: Place, at: Array) -> Waypoint:
        """A place as a waypoint of a task, searched for from near given joint coordinates."""
        if place.joints is not None:
            tolerance = None if place.joint_tolerance is None else np.array(place.joint_tolerance)
            return Waypoint(value=np.array(place.joints), tolerance=tolerance)
        value = np.array(place.value if self.mover.turned else place.tool)
        count = len(self.mover.coordinates)
        room = np.full(len(value), place.angle_tolerance)
        room[:count] = place.tolerance / math.sqrt(count)
        near = self.near(value, at)
        return Waypoint(value=value, through=self.mover.pose, near=near, tolerance=room if room.any() else None)
