"""Motions of the crane as tasks: limits of its joints and drives, its tool, what stands in its way, and costs."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cache, lru_cache
from typing import Any

import casadi as ca
import numpy as np

from trajectories import Cost, MotionLimits, Quantities, Task, Waypoint
from trajectories.obstacle import Obstacle

from .enclosure import enclosure
from .errors import InvalidInputError
from .plants.crane import LIFT, TELESCOPE, TILT, tool
from .plants.crane_dynamics import JOINTS, LIMITS, drives
from .plants.pmsm_emla import PEAK_TORQUE, defaults

#: Shortest lever arm of the actuators of lift and tilt that a motion may use, m/rad; assumed.
LEAST_LEVER = 0.08
#: Largest rates, accelerations and jerks of lift, tilt (rad) and telescope (m); assumed.
SPEED, ACCELERATION, JERK = (0.5, 0.6, 0.13), (0.8, 0.8, 0.5), (8.0, 8.0, 5.0)
UNITS = ("rad", "rad", "m")
#: What a motion of the crane rests on that has no public source.
ASSUMED = (
    "least lever arm", "limits of joint rates, accelerations and jerks", "mounting of the actuators",
    "frames of the telescope's parts and of the end mass",
    *(key.replace("_", " ") for key, p in defaults("voltage").items() if p.source == "assumed" and key != "load_mass"),
)  # fmt: skip


def joint_limits(least_lever: float = LEAST_LEVER) -> MotionLimits:
    """Ranges of the joints inside stroke and away from the singularity, and their largest derivatives."""
    ends = (LIFT.usable(least_lever), TILT.usable(least_lever), (0.0, TELESCOPE))
    return MotionLimits(
        position=(np.array([low for low, _ in ends]), np.array([high for _, high in ends])),
        speed=np.array(SPEED), acceleration=np.array(ACCELERATION), jerk=np.array(JERK),
        names=JOINTS, units=UNITS,
    )  # fmt: skip


@cache
def tool_function() -> ca.Function:
    """Place of the tool in the plane of the crane, m, at joint coordinates. Shapes (3,) -> (2,)."""
    w = ca.SX.sym("w", 3)
    return ca.Function("tool", [w], [ca.vertcat(*tool(w))])


@lru_cache(maxsize=32)
def drive_quantities(payload: float = 0.0, obstacles: tuple[Obstacle, ...] = ()) -> Quantities:
    """Forces, motor speeds, torques, currents and voltages of the EMLAs, and the tool's clearance from obstacles.

    Args:
        payload: Mass at the tool, kg, beside the end mass.
        obstacles: What the tool keeps clear of.
    """
    w, v, a, j = symbols = [ca.SX.sym(name, 3) for name in "wvaj"]
    found = drives(w, v, a, j, payload)
    columns = (found.force, found.speed, found.torque, found.current, found.voltage)
    clear = [obstacle.clearance(tool(w)) for obstacle in obstacles]
    column = ca.Function("drives", symbols, [ca.densify(ca.vertcat(*columns, *clear))])
    names = [f"{joint} {name}" for name, _, _ in LIMITS for joint in JOINTS]
    sizes = np.repeat([limit for _, _, limit in LIMITS], len(JOINTS))
    return Quantities(
        function=column,
        names=(*names, *(f"clearance of {obstacle.name}" for obstacle in obstacles)),
        units=(*(unit for _, unit, _ in LIMITS for _ in JOINTS), *("m" for _ in obstacles)),
        lower=np.concatenate([-sizes, np.zeros(len(obstacles))]),
        upper=np.concatenate([sizes, np.full(len(obstacles), np.inf)]),
        enclose=enclosure(column),
    )


@lru_cache(maxsize=8)
def running_costs(payload: float = 0.0) -> ca.Function:
    """Electrical power drawn, W, what is lost of it, W, and effort, the sum of squared shares of the torque limits."""
    w, v, a, j = symbols = [ca.SX.sym(name, 3) for name in "wvaj"]
    found = drives(w, v, a, j, payload)
    effort = ca.sumsqr(found.torque / PEAK_TORQUE)
    return ca.Function("costs", symbols, [ca.vertcat(ca.sum1(found.power), ca.sum1(found.loss), effort)])


COSTS = ("energy", "loss", "effort")


def crane_cost(*, time: float = 1.0, jerk: float = 0.0, payload: float = 0.0, **weights: float) -> Cost:
    """A weighted sum of duration, squared jerk, and "energy" [1/J], "loss" [1/J], "effort" [1/s].

    Raises:
        InvalidInputError: an unknown cost.
    """
    unknown = sorted(set(weights) - set(COSTS))
    if unknown:
        raise InvalidInputError(f"costs are time, jerk, {', '.join(COSTS)}: got {', '.join(unknown)}; use those")
    return Cost(
        time=time, jerk=jerk, running=running_costs(payload), names=COSTS,
        weights=tuple(weights.get(name, 0.0) for name in COSTS),
    )  # fmt: skip


def crane_task(
    waypoints: Sequence[Any], *, payload: float = 0.0, obstacles: Sequence[Obstacle] = (), **options: Any
) -> Task:
    """A motion of the crane from rest to rest.

    Args:
        waypoints: Joint coordinates, shape (3,), or whole `Waypoint`s.
        payload: Mass at the tool, kg, beside the end mass.
        obstacles: What the tool keeps clear of.
        options: Further entries of `trajectories.Task`.
    """
    places = tuple(p if isinstance(p, Waypoint) else Waypoint(value=np.asarray(p, dtype=float)) for p in waypoints)
    return Task(
        waypoints=places,
        **{"limits": joint_limits(), "quantities": drive_quantities(float(payload), tuple(obstacles)), **options},
    )
