"""A machine of several joints: one plant a joint, what the bodies ask of them, and where the tool is.

The bodies are written once, as F(x, v, a, payload) in coordinates of the actuators. The proof reads F as operations
(`Loads`), the simulation solves it together with the plants, the law foresees it along the reference.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cache, cached_property
from typing import Any

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from stability import Expression, Interval, algebraic
from stability.coupling import PAYLOAD, Loads
from stability.expression import straight_line

from .errors import InvalidInputError
from .plants import Parameter, Plant, defaults, pmsm_emla
from .plants.crane import LIFT, TELESCOPE, TILT, tool
from .plants.crane_dynamics import JOINTS, joints_of, rod_forces
from .plants.plant import Limit
from .plants.rigid_body import Payload, inverse_dynamics, pose
from .plants.rigid_joint import joint_parameters, rigid_joint
from .plants.urdf import Body, bodies

Array = NDArray[np.float64]


@dataclass(frozen=True, kw_only=True)
class Machine:
    """Joints with their actuators, and the bodies that couple them.

    Attributes:
        name: Model name, as in a study.
        joints: Names of the joints.
        plants: The plant of each.
        forces: CasADi function (x, v, a, payload) -> what the bodies ask of each actuator. Shape (n,).
        tool: CasADi function x -> place of the tool, m.
        assumed: What has no public source, beside the parameters that say so.
    """

    name: str
    joints: tuple[str, ...]
    plants: tuple[Plant, ...]
    forces: Any
    tool: Any
    assumed: tuple[str, ...]

    @property
    def own(self) -> tuple[float, ...]:
        """The part of the bodies' inertia that each plant carries itself."""
        return tuple(plant.parameters[carried(plant)].value for plant in self.plants)

    @cached_property
    def expression(self) -> Expression:
        """F as operations over x0…, v0…, a0…, payload."""
        n = len(self.joints)
        flat = ca.SX.sym("flat", 3 * n + 1)
        value = self.forces(flat[:n], flat[n : 2 * n], flat[2 * n : 3 * n], flat[3 * n])
        names = (*(f"{letter}{j}" for letter in "xva" for j in range(n)), PAYLOAD)
        return algebraic(straight_line(ca.Function("forces", [flat], [ca.densify(value)], {"cse": True}), names))

    @cached_property
    def tool_expression(self) -> Expression:
        """The tool's place as operations over x0…."""
        n = len(self.joints)
        flat = ca.SX.sym("flat", n)
        names = tuple(f"x{j}" for j in range(n))
        place = ca.densify(self.tool(flat))
        return algebraic(straight_line(ca.Function("tool", [flat], [place], {"cse": True}), names))

    def loads(self, payload: Interval) -> Loads:
        """What the joints do to each other, as data for the prover."""
        return Loads(expression=self.expression, own=self.own, payload=payload)

    def carrying(self, own: tuple[float, ...]) -> Machine:
        """The same machine with other parts of the bodies' inertia in the plants' own models."""
        plants = tuple(
            _with(plant, carried(plant), replace(plant.parameters[carried(plant)], value=value))
            for plant, value in zip(self.plants, own, strict=True)
        )
        return replace(self, plants=plants)


def carried(plant: Plant) -> str:
    """Name of the parameter that holds a plant's own part of the bodies' inertia."""
    return "load_mass" if plant.name == "pmsm_emla" else "load_inertia"


def _with(plant: Plant, name: str, parameter: Parameter) -> Plant:
    return replace(plant, parameters={**plant.parameters, name: parameter})


def crane(parameters: Mapping[str, Mapping[str, Parameter]], locked: Mapping[str, float] | None = None) -> Machine:
    """The HIAB-class crane with an EMLA at voltage level on every joint, in coordinates of the rods.

    Args:
        parameters: Replacements for those of `pmsm_emla`, by joint.
        locked: Joints that have no actuator, and the stroke at which they stand still, m.

    Returns:
        The machine; its states are those of the EMLAs, 4 a joint.
    """
    fixed = dict(locked or {})
    kept = [k for k, name in enumerate(JOINTS) if name not in fixed]
    known = defaults("voltage")
    massless = {"load_mass": replace(known["load_mass"], value=0.0, tolerance=0.0, source="derived",
                                     meaning="part of the crane's inertia in the axis' own model")}  # fmt: skip
    ends = ((0.0, LIFT.stroke), (0.0, TILT.stroke), (0.0, TELESCOPE))
    plants = [
        replace(pmsm_emla("voltage", {**parameters.get(JOINTS[k], {}), **massless}), stroke=ends[k]) for k in kept
    ]
    n = len(kept)
    x, v, a, payload = ca.SX.sym("x", n), ca.SX.sym("v", n), ca.SX.sym("a", n), ca.SX.sym("payload")

    def whole(part: Any, still: bool) -> Any:
        rest = {name: 0.0 if still else value for name, value in fixed.items()}
        return ca.vertcat(*(part[kept.index(k)] if k in kept else rest[name] for k, name in enumerate(JOINTS)))

    forces = rod_forces(whole(x, still=False), whole(v, still=True), whole(a, still=True), payload)
    place = ca.vertcat(*tool(joints_of(whole(x, still=False))))
    return Machine(
        name="crane", joints=tuple(JOINTS[k] for k in kept), plants=tuple(plants),
        forces=ca.Function("forces", [x, v, a, payload], [ca.vertcat(*(forces[k] for k in kept))]),
        tool=ca.Function("tool", [x], [place]),
        assumed=("mounting of the actuators", "frames of the telescope's parts and of the end mass"),
    )  # fmt: skip


@dataclass(frozen=True, kw_only=True)
class Drive:
    """An actuator of an arm at torque level.

    Attributes:
        armature: Its inertia at the joint, kg m² or kg: value, tolerance, source.
        torque: Largest torque or force, and its source.
        speed: Largest rate, rad/s or m/s.
        effectiveness: Least share of the commanded torque that it delivers.
    """

    armature: tuple[float, float, str]
    torque: tuple[float, str]
    speed: float
    effectiveness: float


def arm(text: str, drives: Mapping[str, Drive], damping: float, tip: tuple[float, float, float]) -> Machine:
    """An arm from URDF with a torque at every joint.

    Args:
        text: The URDF. The joints that `drives` names are a chain from the ground on; all others stand still at 0, and
            what they carry goes with the link that they sit on.
        drives: The actuators by joint.
        damping: Viscous friction of every joint, N m s/rad or N s/m.
        tip: Place of the tool, and of the payload, in the frame of the last body, m.

    Raises:
        InvalidInputError: joints that the file does not have, or that are no chain.
    """
    names = tuple(drives)
    tree, places = _tree(text, names)
    plants = [_driven(tree[place], drives[name], damping) for name, place in zip(names, places, strict=True)]
    n = len(names)
    x, v, a, payload = ca.SX.sym("x", n), ca.SX.sym("v", n), ca.SX.sym("a", n), ca.SX.sym("payload")

    def whole(part: Any) -> Any:
        return ca.vertcat(*(part[places.index(k)] if k in places else 0 for k in range(len(tree))))

    load = Payload(body=places[-1], mass=payload, position=tip)
    forces = inverse_dynamics(tree, whole(x), whole(v), whole(a), payloads=(load,))
    rotation, origin = pose(tree, whole(x), places[-1])
    return Machine(
        name="arm", joints=names, plants=tuple(plants),
        forces=ca.Function("forces", [x, v, a, payload], [ca.vertcat(*(forces[k] for k in places))]),
        tool=ca.Function("tool", [x], [origin + rotation @ ca.DM(tip)]), assumed=(),
    )  # fmt: skip


@cache
def _tree(text: str, names: tuple[str, ...]) -> tuple[tuple[Body, ...], tuple[int, ...]]:
    """All bodies of a file, and the indices of those that named joints move."""
    tree = tuple(bodies(text))
    found = {body.joint: k for k, body in enumerate(tree)}
    missing = [name for name in names if name not in found]
    if missing:
        raise InvalidInputError(f'the URDF has no joint "{missing[0]}"; known: {", ".join(found)}')
    places = tuple(found[name] for name in names)
    for k, place in enumerate(places):
        if tree[place].parent != (places[k - 1] if k else -1):
            raise InvalidInputError(
                f'the joints of an arm follow each other: "{names[k]}" does not move with the one before; '
                "name all joints of the chain, from the ground on"
            )
    return tree, places


def _driven(body: Body, drive: Drive, damping: float) -> Plant:
    unit = "N m" if body.kind == "revolute" else "N"
    middle = (1 + drive.effectiveness) / 2
    parameters = joint_parameters(
        body.kind, armature=drive.armature, load_inertia=(0.0, 0.0, "derived"),
        effectiveness=(middle, 1 - drive.effectiveness / middle, "assumed"), damping=(damping, 0.5, "assumed"),
    )  # fmt: skip
    size, source = drive.torque
    limit = Limit(name="torque", signals=("torque_command",), value=size, unit=unit, source=source)
    widest = 2 * math.pi if body.kind == "revolute" else 10.0
    travel = (max(body.limits[0], -widest), min(body.limits[1], widest))
    return rigid_joint(body.kind, parameters, torque=limit, speed=drive.speed, travel=travel)
