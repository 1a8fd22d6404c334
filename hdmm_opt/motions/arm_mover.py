"""An arm from URDF as a mover: torques at the joints by inverse dynamics."""

from __future__ import annotations

from functools import lru_cache
from typing import Any

import casadi as ca
import numpy as np

from trajectories import MotionLimits

from ..machines.machine import Machine
from .mover import Drives, Mover


def arm_mover(machine: Machine) -> Mover:
    """A machine whose members are joints driven by torques.

    Args:
        machine: The machine; its plants give inertia, friction, torque, speed and range of each joint.

    Not guaranteed: accelerations and jerks of the joints are not limited unless a job does.
    """
    plants, count = machine.plants, len(machine.members)
    own = np.array([plant.parameters["armature"].value for plant in plants])
    damping = np.array([plant.parameters["damping"].value for plant in plants])
    torque, speed = (np.array([_limit(plant, name) for plant in plants]) for name in ("torque", "speed"))
    strokes = np.array([plant.stroke for plant in plants])

    @lru_cache(maxsize=8)
    def drives(payload: float) -> Drives:
        w, v, a, _ = symbols = [ca.SX.sym(name, count) for name in "wvaj"]
        torques = machine.forces(w, v, a, payload) + ca.DM(own) * a + ca.DM(damping) * v
        return Drives(
            function=ca.Function("drives", symbols, [ca.densify(torques)]), kinds=(("torque", ""),), sizes=tuple(torque)
        )

    @lru_cache(maxsize=8)
    def costs(payload: float) -> Any:
        symbols = [ca.SX.sym(name, count) for name in "wvaj"]
        return ca.Function("costs", symbols, [ca.sumsqr(drives(payload).function(*symbols) / ca.DM(torque))])

    units = tuple(plant.state_units[0] for plant in plants)
    return Mover(
        limits=MotionLimits(
            position=(strokes[:, 0], strokes[:, 1]), speed=speed, acceleration=np.full(count, np.inf),
            jerk=np.full(count, np.inf), names=machine.members, units=units,
        ),
        pose=machine.place, coordinates=machine.coordinates, turned=False, drives=drives, costs=costs,
        cost_names=("effort",),
        assumed=tuple(
            f"{name} {key}" for name, plant in zip(machine.members, plants, strict=True)
            for key in ("armature", "damping") if plant.parameters[key].source == "assumed"
        ),
    )  # fmt: skip


def _limit(plant: Any, name: str) -> float:
    return next(limit.value for limit in plant.limits if limit.name == name)
