"""Rigid bodies read from a URDF file: a tree of bodies on revolute and prismatic joints."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Literal
from xml.etree import ElementTree

import numpy as np
from numpy.typing import NDArray

from ..errors import InvalidInputError

Array = NDArray[np.float64]


@dataclass(frozen=True, kw_only=True)
class Body:
    """What moves with one joint, and where the joint sits.

    Attributes:
        joint: Name of the joint that moves it.
        parent: Index of the body that carries the joint; -1 for the ground.
        kind: "revolute" about the axis, or "prismatic" along it.
        axis: Unit vector in the body's frame. Shape (3,).
        rotation: Body frame in the parent's frame at joint position 0. Shape (3, 3).
        position: Its origin there, m. Shape (3,).
        mass: Mass, kg.
        moment: Mass times centre of mass, in the body's frame, kg m. Shape (3,).
        inertia: Inertia about the origin of the body's frame, kg m². Shape (3, 3).
        limits: Lowest and highest joint position, rad or m; infinite where the file gives none.
    """

    joint: str
    parent: int
    kind: Literal["revolute", "prismatic"]
    axis: Array
    rotation: Array
    position: Array
    mass: float
    moment: Array
    inertia: Array
    limits: tuple[float, float]


@dataclass(frozen=True, kw_only=True)
class _Inertia:
    mass: float
    moment: Array
    inertia: Array

    def seen_from(self, rotation: Array, position: Array) -> _Inertia:
        """The same in a frame in which this one lies at (rotation, position)."""
        turned, own = rotation @ self.moment, rotation @ self.inertia @ rotation.T
        both = np.outer(position, turned) + np.outer(turned, position)
        shift = (2 * position @ turned) * np.eye(3) - both
        shift += self.mass * ((position @ position) * np.eye(3) - np.outer(position, position))
        return _Inertia(mass=self.mass, moment=turned + self.mass * position, inertia=own + shift)

    def __add__(self, other: _Inertia) -> _Inertia:
        return _Inertia(
            mass=self.mass + other.mass, moment=self.moment + other.moment, inertia=self.inertia + other.inertia
        )


def bodies(text: str) -> tuple[Body, ...]:
    """Read the tree of a URDF file; links on fixed joints become part of what carries them.

    Args:
        text: The file.

    Returns:
        The bodies, each after its parent, in the order of the file where that allows it.

    Raises:
        InvalidInputError: not a URDF file, no single root, a kind of joint that is not known here, or numbers that are
            missing or not physical.
    """
    try:
        robot = ElementTree.fromstring(text)
    except ElementTree.ParseError as error:
        raise InvalidInputError(f"URDF: not valid XML: {error}; correct that line") from None
    links = {_name(link): link for link in robot.findall("link")}
    joints: dict[str, list[ElementTree.Element]] = {}
    children = set()
    for joint in robot.findall("joint"):
        ends = [_end(joint, which, links) for which in ("parent", "child")]
        if ends[1] in children:
            raise InvalidInputError(f'URDF: a link hangs on one joint: "{ends[1]}" hangs on two; open the loop')
        children.add(ends[1])
        joints.setdefault(ends[0], []).append(joint)
    roots = [name for name in links if name not in children]
    if len(roots) != 1:
        raise InvalidInputError(
            f"URDF: one root link is needed: got {', '.join(roots) or 'none'}; join them or remove one"
        )
    reader = _Reader(links, joints)
    reader.carried(roots[0], -1)
    return tuple(reader.found)


class _Reader:
    """Walks the tree from the root."""

    def __init__(self, links: dict[str, ElementTree.Element], joints: dict[str, list[ElementTree.Element]]) -> None:
        self.links, self.joints = links, joints
        self.found: list[Body] = []

    def carried(self, link: str, body: int) -> _Inertia:
        """Inertia of a link and of all that is fixed to it; the bodies on its joints are read on the way."""
        return self._gathered(link, body, np.eye(3), np.zeros(3))

    def _gathered(self, link: str, body: int, rotation: Array, position: Array) -> _Inertia:
        whole = _inertia(self.links[link]).seen_from(rotation, position)
        for joint in self.joints.get(link, []):
            own_rotation, own_position = _origin(joint)
            place = (rotation @ own_rotation, rotation @ own_position + position)
            child = _end(joint, "child", self.links)
            if joint.get("type") == "fixed":
                whole = whole + self._gathered(child, body, *place)
            else:
                self._moved(joint, child, body, *place)
        return whole

    def _moved(self, joint: ElementTree.Element, child: str, parent: int, rotation: Array, position: Array) -> None:
        index = len(self.found)
        head = _joint(joint, parent, rotation, position)
        self.found.append(head)
        own = self.carried(child, index)
        if not own.mass > 0:
            raise InvalidInputError(f'URDF: what moves with joint "{head.joint}" needs a mass: got {own.mass:g} kg')
        self.found[index] = Body(**{**vars(head), "mass": own.mass, "moment": own.moment, "inertia": own.inertia})


def _joint(joint: ElementTree.Element, parent: int, rotation: Array, position: Array) -> Body:
    name, kind = _name(joint), joint.get("type")
    if kind not in ("revolute", "continuous", "prismatic"):
        raise InvalidInputError(f'URDF: joints are revolute, continuous, prismatic or fixed: "{name}" is {kind}')
    if joint.find("mimic") is not None:
        raise InvalidInputError(f'URDF: joint "{name}" mimics another one, which is not known here; give it its own')
    axis = _vector(joint.find("axis"), "xyz", (1.0, 0.0, 0.0), name)
    length = float(np.linalg.norm(axis))
    if not length > 0:
        raise InvalidInputError(f'URDF: the axis of joint "{name}" has no direction: got zeros; give one')
    limit = joint.find("limit")
    ends = (-math.inf, math.inf)
    if limit is not None and kind != "continuous":
        ends = (_number(limit, "lower", 0.0, name), _number(limit, "upper", 0.0, name))
    return Body(
        joint=name, parent=parent, kind="prismatic" if kind == "prismatic" else "revolute", axis=axis / length,
        rotation=rotation, position=position, mass=0.0, moment=np.zeros(3), inertia=np.zeros((3, 3)), limits=ends,
    )  # fmt: skip


def _inertia(link: ElementTree.Element) -> _Inertia:
    """A link's inertia about the origin of its frame; nothing where the file gives none."""
    given, name = link.find("inertial"), _name(link)
    if given is None:
        return _Inertia(mass=0.0, moment=np.zeros(3), inertia=np.zeros((3, 3)))
    mass_element, inertia_element = given.find("mass"), given.find("inertia")
    if mass_element is None or inertia_element is None:
        raise InvalidInputError(f'URDF: the inertial of link "{name}" needs mass and inertia; add what is missing')
    mass = _number(mass_element, "value", math.nan, name)
    values = {key: _number(inertia_element, key, 0.0, name) for key in ("ixx", "ixy", "ixz", "iyy", "iyz", "izz")}
    matrix = np.array([
        [values["ixx"], values["ixy"], values["ixz"]],
        [values["ixy"], values["iyy"], values["iyz"]],
        [values["ixz"], values["iyz"], values["izz"]],
    ])  # fmt: skip
    principal = np.linalg.eigvalsh(matrix)
    slack = 1e-9 * max(1.0, float(np.abs(principal).max()))
    if not (mass >= 0 and principal[0] >= -slack and principal[2] <= principal[0] + principal[1] + slack):
        raise InvalidInputError(
            f'URDF: link "{name}" is no rigid body: mass {mass:g} kg, principal inertias '
            f"{', '.join(f'{v:.4g}' for v in principal)} kg m^2; none may be negative or above the sum of the others"
        )
    rotation, centre = _origin(given)
    return _Inertia(mass=mass, moment=np.zeros(3), inertia=matrix).seen_from(rotation, centre)


def _origin(element: ElementTree.Element) -> tuple[Array, Array]:
    """Rotation and position of an element; rpy is roll about x, then pitch about y, then yaw about z, fixed axes."""
    origin, name = element.find("origin"), _name(element)
    roll, pitch, yaw = _vector(origin, "rpy", (0.0, 0.0, 0.0), name)
    cr, sr, cp, sp, cy, sy = (f(a) for a in (roll, pitch, yaw) for f in (math.cos, math.sin))
    rotation = np.array([
        [cy * cp, cy * sp * sr - sy * cr, cy * sp * cr + sy * sr],
        [sy * cp, sy * sp * sr + cy * cr, sy * sp * cr - cy * sr],
        [-sp, cp * sr, cp * cr],
    ])  # fmt: skip
    return rotation, _vector(origin, "xyz", (0.0, 0.0, 0.0), name)


def _end(joint: ElementTree.Element, which: str, links: dict[str, ElementTree.Element]) -> str:
    element = joint.find(which)
    name = None if element is None else element.get("link")
    if name not in links:
        raise InvalidInputError(f'URDF: the {which} of joint "{_name(joint)}" must be a link: got {name}; correct it')
    return str(name)


def _name(element: ElementTree.Element) -> str:
    return element.get("name", element.tag)


def _vector(element: ElementTree.Element | None, key: str, default: tuple[float, ...], where: str) -> Array:
    text = None if element is None else element.get(key)
    if text is None:
        return np.array(default)
    try:
        values = np.array([float(part) for part in text.split()])
    except ValueError:
        values = np.zeros(0)
    if values.shape != (3,) or not np.isfinite(values).all():
        raise InvalidInputError(f'URDF: {key} at "{where}" needs three finite numbers: got "{text}"; correct it')
    return values


def _number(element: ElementTree.Element, key: str, default: float, where: str) -> float:
    text = element.get(key)
    try:
        value = default if text is None else float(text)
    except ValueError:
        value = math.nan
    if not math.isfinite(value):
        raise InvalidInputError(f'URDF: {key} at "{where}" needs a finite number: got {text}; correct it')
    return value
