"""Studies of a motion alone: a machine, moves to make, and how the motion is chosen; no controller."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Annotated, Any, Literal

from pydantic import Field, model_validator

from ..machines.crane_dynamics import JOINTS
from ..machines.crane_limits import COSTS, LEAST_LEVER, joint_limits
from ..machines.registry import model
from .machine import PlantSection
from .messages import refused
from .sections import NonNegative, Positive, Section, StudySection

#: Machines whose motions a study can ask for, and the coordinates of their tools' places.
DIMENSIONS = {"crane": 2, "arm": 3}
#: A place in the plane or in space, m; an entry for each joint, rad or m.
Point = Annotated[tuple[float, ...], Field(min_length=2, max_length=3)]
Joints = Annotated[tuple[float, ...], Field(min_length=1, max_length=16)]


class PlaceSection(Section):
    """A place of the tool, or joint coordinates, with tolerances."""

    tool_m: Point | None = None
    angle_rad: float | None = None
    joints: Joints | None = None
    tolerance_m: Positive | None = None
    angle_tolerance_rad: Positive | None = None
    tolerances: tuple[NonNegative, ...] | None = None

    @model_validator(mode="after")
    def _fitting(self) -> PlaceSection:
        self._one_goal()
        for key, value, beside in (
            ("angle_rad", self.angle_rad, ("tool_m", "path_m")), ("tolerances", self.tolerances, ("joints",)),
            ("tolerance_m", self.tolerance_m, ("tool_m", "path_m")),
            ("angle_tolerance_rad", self.angle_tolerance_rad, ("angle_rad",)),
        ):  # fmt: skip
            if value is not None and not any(getattr(self, name, None) is not None for name in beside):
                raise refused(key, f"stands beside {' or '.join(beside)}: got it alone", "remove it, or give the other")
        return self

    def _one_goal(self) -> None:
        if (self.tool_m is None) == (self.joints is None):
            raise refused("", "needs either tool_m or joints", "give one of the two")


class MoveSection(PlaceSection):
    """A move to a place, by way of others that are passed without a stop, or along a path of the tool."""

    via: Annotated[tuple[PlaceSection, ...], Field(max_length=30)] = ()
    path_m: Annotated[tuple[Point, ...], Field(min_length=1, max_length=8)] | None = None
    speed: Joints | None = None
    payload_kg: NonNegative = 0.0

    def _one_goal(self) -> None:
        if sum(goal is not None for goal in (self.tool_m, self.joints, self.path_m)) != 1:
            raise refused("", "needs tool_m, joints or path_m", "give one of the three")
        if self.path_m is not None and self.tolerance_m is None:
            raise refused("tolerance_m", "is required with path_m", "say how far the tool may be from its path")
        if self.path_m is not None and self.angle_rad is not None and self.angle_tolerance_rad is None:
            raise refused("angle_tolerance_rad", "is required with path_m and angle_rad", "add it")
        if self.path_m is not None and self.via:
            raise refused("via", "has no place beside path_m", "make the path pass there")
        if self.speed is not None and self.joints is None:
            raise refused("speed", "is that of the joints at the end, and stands beside joints", "give joints")
        if self.speed is not None and self.tolerances is not None:
            raise refused("tolerances", "has no place beside speed", "remove one of the two")


#: No machine is limited to less, in SI units; what is smaller is a mistake in the unit.
Limit = Annotated[float, Field(ge=1e-4)]
Sizes = Annotated[tuple[Limit, ...], Field(min_length=1, max_length=16)]


class LimitsSection(Section):
    """Limits of a motion; what a study leaves out is the machine's. The first three have an entry for each joint."""

    speed: Sizes | None = None
    acceleration: Sizes | None = None
    jerk: Sizes | None = None
    rod_force_n: Limit | None = None
    motor_speed_rad_s: Limit | None = None
    motor_torque_nm: Limit | None = None
    current_a: Limit | None = None
    voltage_v: Limit | None = None
    tool_speed_m_s: Limit | None = None
    tool_acceleration_m_s2: Limit | None = None


class ObstacleSection(Section):
    """A ball, or a half-space beyond a wall, that the tool keeps clear of."""

    name: Annotated[str, Field(min_length=1, max_length=64)]
    centre_m: Point | None = None
    radius_m: Positive | None = None
    normal: Point | None = None
    offset_m: float | None = None

    @model_validator(mode="after")
    def _one_kind(self) -> ObstacleSection:
        ball, wall = (self.centre_m, self.radius_m), (self.normal, self.offset_m)
        for given, other in ((ball, wall), (wall, ball)):
            if None not in given and other == (None, None):
                break
        else:
            raise refused("", "needs either centre_m and radius_m, or normal and offset_m", "give one of the two pairs")
        if self.normal is not None and not abs(sum(n**2 for n in self.normal) - 1) < 1e-6:
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
    """The moves, and how their motions are chosen.

    By a spline program, straight between joint coordinates by TOPP-RA or Ruckig, or by a leader and a follower.
    """

    kind: Literal["bspline", "toppra", "ruckig", "bilevel"]
    start: Joints
    start_speed: Joints | None = None
    start_acceleration: Joints | None = None
    longest_s: Annotated[float, Field(ge=0.01)] = 60.0
    spans: Annotated[int, Field(ge=6, le=200)] | None = None
    limits: LimitsSection = LimitsSection()
    cost: CostSection | None = None
    evaluations: Annotated[int, Field(ge=2, le=10_000)] | None = None
    moves: Annotated[tuple[MoveSection, ...], Field(min_length=1, max_length=10)]
    obstacles: Annotated[tuple[ObstacleSection, ...], Field(max_length=20)] = ()

    @model_validator(mode="after")
    def _fitting(self) -> JobSection:
        kind = self.kind
        if kind != "bspline" and (self.cost is not None or any(m.via or m.path_m is not None for m in self.moves)):
            raise refused("", f'has no cost, no via and no path_m with kind = "{kind}"',
                          'remove them, or use kind = "bspline"')  # fmt: skip
        moving = self.start_speed is not None or any(move.speed is not None for move in self.moves)
        if kind in ("bilevel", "toppra") and moving:
            raise refused("", f'moves from rest to rest with kind = "{kind}"', 'remove speeds, or use kind = "bspline"')
        if self.start_acceleration is not None and self.start_speed is None:
            raise refused("start_acceleration", "stands beside start_speed", "give the speed too")
        if self.evaluations is not None and kind != "bilevel":
            raise refused("evaluations", f'has no place with kind = "{kind}"', "remove it")
        if self.spans is not None and kind in ("toppra", "ruckig"):
            raise refused("spans", f'has no place with kind = "{kind}"', "remove it")
        if kind == "ruckig" and self.obstacles:
            raise refused("obstacles", 'are not steered round with kind = "ruckig"', 'use kind = "bspline"')
        return self

    def lists(self) -> Iterator[tuple[str, tuple[float, ...] | None]]:
        """Every list with an entry for each joint, and its key."""
        yield from ((key, getattr(self, key)) for key in ("start", "start_speed", "start_acceleration"))
        yield from ((f"limits.{key}", getattr(self.limits, key)) for key in ("speed", "acceleration", "jerk"))
        for where, place in self.places():
            yield f"{where}.joints", place.joints
            yield f"{where}.tolerances", place.tolerances
        yield from ((f"moves.{k}.speed", move.speed) for k, move in enumerate(self.moves))

    def places(self) -> Iterator[tuple[str, PlaceSection]]:
        """Every place, and its key."""
        for k, move in enumerate(self.moves):
            yield from ((f"moves.{k}.via.{j}", place) for j, place in enumerate(move.via))
            yield f"moves.{k}", move

    def points(self) -> Iterator[tuple[str, Point | None]]:
        """Every place of the tool or of an obstacle, and its key."""
        for where, place in self.places():
            yield f"{where}.tool_m", place.tool_m
        for k, move in enumerate(self.moves):
            yield from ((f"moves.{k}.path_m", point) for point in move.path_m or ())
        for k, entry in enumerate(self.obstacles):
            yield from ((f"obstacles.{k}.{key}", getattr(entry, key)) for key in ("centre_m", "normal"))


class MotionStudy(Section):
    """A whole file of this kind."""

    study: StudySection
    plant: PlantSection
    reference: JobSection

    @model_validator(mode="before")
    @classmethod
    def _known(cls, data: Any) -> Any:
        plant = data.get("plant") if isinstance(data, dict) else None
        if isinstance(plant, dict) and isinstance(plant.get("model"), str) and plant["model"] not in DIMENSIONS:
            rule = f'of a motion alone is "crane" or "arm": got {plant["model"][:40]!r}'
            raise refused("plant.model", rule, "use one of them, or add a controller")
        return data

    @model_validator(mode="after")
    def _fitting(self) -> MotionStudy:
        plant, reference = self.plant, self.reference
        crane = plant.model == "crane"
        for key in ("parameters", "ratings", "limits", "joints", "locked") if crane else ():
            if getattr(plant, key):
                raise refused(f"plant.{key}", "has no place in a motion of the crane alone", "give reference.limits")
        members = model(plant.model).members(plant)
        for key, entries in reference.lists():
            if entries is not None and len(entries) != len(members):
                rule = f"must have one entry for each of {', '.join(members)}: got {len(entries)}"
                raise refused(f"reference.{key}", rule, "complete it")
        for key, point in reference.points():
            if point is not None and len(point) != DIMENSIONS[plant.model]:
                rule = f"has {DIMENSIONS[plant.model]} coordinates with this machine: got {len(point)}"
                raise refused(f"reference.{key}", rule, "complete it")
        if not crane:
            self._of_an_arm()
        else:
            self._inside()
        return self

    def _of_an_arm(self) -> None:
        reference = self.reference
        if reference.kind == "bilevel":
            raise refused("reference.kind", '"bilevel" is for the crane', 'use kind = "bspline"')
        for key in ("rod_force_n", "motor_speed_rad_s", "motor_torque_nm", "current_a", "voltage_v"):
            if getattr(reference.limits, key) is not None:
                raise refused(f"reference.limits.{key}", "has no place with an arm", "give plant.joints.NAME.limits")
        for where, place in reference.places():
            if place.angle_rad is not None:
                rule = "has no place with an arm: its tool is a point"
                raise refused(f"reference.{where}.angle_rad", rule, "remove it")
        cost = reference.cost
        if cost is not None and (cost.energy or cost.loss):
            raise refused("reference.cost", "of an arm has no energy and no loss", "use time, jerk or effort")

    def _inside(self) -> None:
        """Joint coordinates of the crane are inside their ranges."""
        lever = self.plant.least_lever_m_rad
        low_ends, high_ends = joint_limits(LEAST_LEVER if lever is None else lever).room
        given = [("start", self.reference.start)]
        given += [(f"{where}.joints", p.joints) for where, p in self.reference.places() if p.joints is not None]
        for key, place in given:
            for name, value, low, high in zip(JOINTS, place, low_ends, high_ends, strict=True):
                if not low <= value <= high:
                    rule = f"must keep the {name} between {low:.4g} and {high:.4g}: got {value:g}"
                    raise refused(f"reference.{key}", rule, "move the place, or allow a shorter lever")
