"""The crane as a mover, and motions of it as tasks."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cache, lru_cache
from typing import Any

import casadi as ca
import numpy as np

from trajectories import Cost, Quantities, Task, Waypoint
from trajectories.obstacle import Obstacle

from ..machines.crane_dynamics import JOINTS, drive_limits, drives
from ..machines.crane_geometry import tool
from ..machines.crane_limits import COSTS, LEAST_LEVER, joint_limits
from ..plants.pmsm_emla import defaults
from .mover import Drives, Mover

#: What a motion of the crane rests on that has no public source.
ASSUMED = (
    "least lever arm", "limits of joint rates, accelerations and jerks",
    *(key.replace("_", " ") for key, p in defaults("voltage").items() if p.source == "assumed" and key != "load_mass"),
)  # fmt: skip


@lru_cache(maxsize=8)
def crane_mover(least_lever: float = LEAST_LEVER) -> Mover:
    """Lift, tilt and telescope with an EMLA each; the angle of the tool is that of the telescope above the horizon.

    Args:
        least_lever: Shortest admissible lever arm of the actuators of lift and tilt, m/rad.
    """
    w = ca.SX.sym("w", 3)
    across, up = tool(w)
    return Mover(
        limits=joint_limits(least_lever), pose=ca.Function("pose", [w], [ca.vertcat(across, up, w[0] + w[1])]),
        coordinates=("x", "z"), turned=True, drives=_drives, costs=running_costs, cost_names=COSTS, assumed=ASSUMED,
    )  # fmt: skip


@cache
def tool_function() -> ca.Function:
    """Place of the tool in the plane of the crane, m, at joint coordinates. Shapes (3,) -> (2,)."""
    w = ca.SX.sym("w", 3)
    return ca.Function("tool", [w], [ca.vertcat(*tool(w))])


@lru_cache(maxsize=8)
def _drives(payload: float) -> Drives:
    """Forces, motor speeds, torques, currents and voltages of the EMLAs."""
    w, v, a, j = symbols = [ca.SX.sym(name, 3) for name in "wvaj"]
    found = drives(w, v, a, j, payload)
    column = ca.vertcat(found.force, found.speed, found.torque, found.current, found.voltage)
    limits = drive_limits()
    return Drives(
        function=ca.Function("drives", symbols, [ca.densify(column)]),
        kinds=tuple((name, unit) for name, unit, _ in limits),
        sizes=tuple(size for _, _, size in limits for _ in JOINTS),
    )


@lru_cache(maxsize=8)
def running_costs(payload: float = 0.0) -> ca.Function:
    """Electrical power drawn, W, what is lost of it, W, and effort, the sum of squared shares of the torque limits."""
    w, v, a, j = symbols = [ca.SX.sym(name, 3) for name in "wvaj"]
    found = drives(w, v, a, j, payload)
    effort = ca.sumsqr(found.torque / dict((name, value) for name, _, value in drive_limits())["motor torque"])
    return ca.Function("costs", symbols, [ca.vertcat(ca.sum1(found.power), ca.sum1(found.loss), effort)])


def drive_quantities(payload: float = 0.0, obstacles: tuple[Obstacle, ...] = ()) -> Quantities:
    """What is limited in a motion of the crane beside its joints; see `Mover.quantities`."""
    return crane_mover().quantities(payload, obstacles)


def crane_cost(**weights: float) -> Cost:
    """The cost of a motion of the crane; see `Mover.cost`."""
    return crane_mover().cost(**weights)


def crane_task(
    waypoints: Sequence[Any], *, payload: float = 0.0, obstacles: Sequence[Obstacle] = (), **options: Any
) -> Task:
    """A motion of the crane.

    Args:
        waypoints: Joint coordinates, shape (3,), or whole `Waypoint`s.
        payload: Mass at the tool, kg, beside the end mass.
        obstacles: What the tool keeps clear of.
        options: Further entries of `trajectories.Task`.
    """
    places = tuple(p if isinstance(p, Waypoint) else Waypoint(value=np.asarray(p, dtype=float)) for p in waypoints)
    quantities = drive_quantities(float(payload), tuple(obstacles))
    return Task(waypoints=places, **{"limits": joint_limits(), "quantities": quantities, **options})
