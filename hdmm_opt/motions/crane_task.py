"""Motions of the crane as tasks: limits of its joints and drives, its tool, what stands in its way, and costs."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
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


#: Name and unit of the squared speed and acceleration of the tool.
SQUARES = (("squared speed of the tool", "m^2/s^2"), ("squared acceleration of the tool", "m^2/s^4"))


@cache
def tool_function() -> ca.Function:
    """Place of the tool in the plane of the crane, m, at joint coordinates. Shapes (3,) -> (2,)."""
    w = ca.SX.sym("w", 3)
    return ca.Function("tool", [w], [ca.vertcat(*tool(w))])


@dataclass(frozen=True, kw_only=True)
class Bounded:
    """Limits of a job in place of the crane's.

    Attributes:
        speed, acceleration, jerk: Of lift, tilt, telescope, rad and m. Each shape (3,), or None.
        drives: Of every EMLA by name: "force", "motor speed", "motor torque", "current", "voltage".
        tool: Largest speed, m/s, and acceleration, m/s², of the tool; infinite for none.
    """

    speed: tuple[float, float, float] | None = None
    acceleration: tuple[float, float, float] | None = None
    jerk: tuple[float, float, float] | None = None
    drives: tuple[tuple[str, float], ...] = ()
    tool: tuple[float, float] = (math.inf, math.inf)

    @property
    def joints(self) -> dict[str, tuple[float, float, float]]:
        """Those of the joints that are given."""
        own = {name: getattr(self, name) for name in ("speed", "acceleration", "jerk")}
        return {name: value for name, value in own.items() if value is not None}


def tool_rates(w: Any, v: Any, a: Any) -> list[Any]:
    """Squared speed, m²/s², and squared acceleration, m²/s⁴, of the tool: a norm has no slope at rest."""
    place = ca.vertcat(*tool(w))
    speed = ca.jtimes(place, w, v)
    gain = ca.jtimes(speed, w, v) + ca.jtimes(speed, v, a)
    return [ca.sumsqr(speed), ca.sumsqr(gain)]


@lru_cache(maxsize=32)
def drive_quantities(
    payload: float = 0.0, obstacles: tuple[Obstacle, ...] = (), bounds: Bounded | None = None
) -> Quantities:
    """Forces, motor speeds, torques, currents and voltages of the EMLAs, and the tool's clearance from obstacles.

    Args:
        payload: Mass at the tool, kg, beside the end mass.
        obstacles: What the tool keeps clear of.
        bounds: Limits in place of the crane's, and those of the tool.
    """
    bounds = bounds or Bounded()
    w, v, a, j = symbols = [ca.SX.sym(name, 3) for name in "wvaj"]
    found = drives(w, v, a, j, payload)
    columns = (found.force, found.speed, found.torque, found.current, found.voltage)
    clear = [obstacle.clearance(tool(w)) for obstacle in obstacles]
    kinds = [k for k, size in enumerate(bounds.tool) if math.isfinite(size)]
    rates = [tool_rates(w, v, a)[k] for k in kinds]
    column = ca.Function("drives", symbols, [ca.densify(ca.vertcat(*columns, *clear, *rates))])
    given = dict(bounds.drives)
    limits = [(name, unit, given.get(name, size)) for name, unit, size in drive_limits()]
    names = [f"{joint} {name}" for name, _, _ in limits for joint in JOINTS]
    sizes = np.repeat([limit for _, _, limit in limits], len(JOINTS))
    return Quantities(
        function=column,
        names=(*names, *(f"clearance of {obstacle.name}" for obstacle in obstacles), *(SQUARES[k][0] for k in kinds)),
        units=(
            *(unit for _, unit, _ in limits for _ in JOINTS),
            *("m" for _ in obstacles),
            *(SQUARES[k][1] for k in kinds),
        ),
        lower=np.concatenate([-sizes, np.zeros(len(obstacles)), np.full(len(kinds), -np.inf)]),
        upper=np.concatenate([sizes, np.full(len(obstacles), np.inf), [bounds.tool[k] ** 2 for k in kinds]]),
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
    waypoints: Sequence[Any], *, payload: float = 0.0, obstacles: Sequence[Obstacle] = (),
    bounds: Bounded | None = None, **options: Any,
) -> Task:  # fmt: skip
    """A motion of the crane from rest to rest.

    Args:
        waypoints: Joint coordinates, shape (3,), or whole `Waypoint`s.
        payload: Mass at the tool, kg, beside the end mass.
        obstacles: What the tool keeps clear of.
        bounds: Limits in place of the crane's, and those of the tool.
        options: Further entries of `trajectories.Task`.
    """
    places = tuple(p if isinstance(p, Waypoint) else Waypoint(value=np.asarray(p, dtype=float)) for p in waypoints)
    return Task(
        waypoints=places,
        **{
            "limits": joint_limits(),
            "quantities": drive_quantities(float(payload), tuple(obstacles), bounds),
            **options,
        },
    )
