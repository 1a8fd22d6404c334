"""Motions of the crane as tasks: limits of its joints and drives, its tool, what stands in its way, and costs."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cache, lru_cache
from typing import Any

import casadi as ca
import numpy as np

from trajectories import Cost, Quantities, Task, Waypoint
from trajectories.obstacle import Obstacle

from ..errors import InvalidInputError
from ..machines.crane_dynamics import JOINTS, drive_limits, drives
from ..machines.crane_geometry import tool
from ..machines.crane_limits import COSTS, joint_limits
from ..plants.pmsm_emla import defaults
from .enclosure import enclosure

#: What a motion of the crane rests on that has no public source.
ASSUMED = (
    "least lever arm", "limits of joint rates, accelerations and jerks",
    *(key.replace("_", " ") for key, p in defaults("voltage").items() if p.source == "assumed" and key != "load_mass"),
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
    limits = drive_limits()
    names = [f"{joint} {name}" for name, _, _ in limits for joint in JOINTS]
    sizes = np.repeat([limit for _, _, limit in limits], len(JOINTS))
    return Quantities(
        function=column,
        names=(*names, *(f"clearance of {obstacle.name}" for obstacle in obstacles)),
        units=(*(unit for _, unit, _ in limits for _ in JOINTS), *("m" for _ in obstacles)),
        lower=np.concatenate([-sizes, np.zeros(len(obstacles))]),
        upper=np.concatenate([sizes, np.full(len(obstacles), np.inf)]),
        enclose=enclosure(column),
    )


@lru_cache(maxsize=8)
def running_costs(payload: float = 0.0) -> ca.Function:
    """Electrical power drawn, W, what is lost of it, W, and effort, the sum of squared shares of the torque limits."""
    w, v, a, j = symbols = [ca.SX.sym(name, 3) for name in "wvaj"]
    found = drives(w, v, a, j, payload)
    effort = ca.sumsqr(found.torque / dict((name, value) for name, _, value in drive_limits())["motor torque"])
    return ca.Function("costs", symbols, [ca.vertcat(ca.sum1(found.power), ca.sum1(found.loss), effort)])


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
