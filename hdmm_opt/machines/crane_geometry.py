"""Geometry of a HIAB-class loader crane: lift, tilt, telescope, and the linear actuators of the first two joints.

Joint coordinates are w1 and w2 in rad, w3 in m; the crane moves in a vertical plane. An actuator between two points at
distances a and b from a joint closes a triangle,

    x = sqrt(a² + b² + 2 a b cos q) - x0,    q = w + offset,    dx/dq = -a b sin(q) / (x + x0),

whose lever arm vanishes where the three points are in line: there the actuator can hold no torque.

Source of the dimensions: public data of the HIAB XS 031 (source tag "public"); EMLAs stand in the place of its
cylinders.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache
from typing import TYPE_CHECKING, Any

from ..errors import InvalidInputError

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray


@dataclass(frozen=True, kw_only=True)
class ActuatorLoop:
    """A linear actuator across a joint.

    Attributes:
        name: Name of the joint.
        a: Distance from the joint to one end of the actuator, m.
        b: Distance from the joint to the other end, m.
        dead: Length of the actuator at stroke 0, m.
        stroke: Longest stroke, m.
        offset: Angle q minus joint coordinate w, rad.
    """

    name: str
    a: float
    b: float
    dead: float
    stroke: float
    offset: float

    @property
    def singular_stroke(self) -> float:
        """The stroke at which the lever arm vanishes because the actuator is stretched out, m."""
        return self.a + self.b - self.dead

    def extension(self, w: Any) -> Any:
        """Stroke at a joint coordinate, m; symbols or numbers."""
        import casadi as ca

        q = w + self.offset
        return ca.sqrt(self.a**2 + self.b**2 + 2 * self.a * self.b * ca.cos(q)) - self.dead

    def lever(self, w: Any) -> Any:
        """dx/dw, m/rad: rate of the stroke over that of the joint, and torque over force."""
        import casadi as ca

        return -self.a * self.b * ca.sin(w + self.offset) / (self.extension(w) + self.dead)

    def coordinate(self, x: Any) -> Any:
        """Joint coordinate at a stroke, rad, on the branch -π < q < 0 on which the crane works."""
        import casadi as ca

        length = x + self.dead
        return -ca.acos((length**2 - self.a**2 - self.b**2) / (2 * self.a * self.b)) - self.offset

    def usable(self, least_lever: float) -> tuple[float, float]:
        """Joint coordinates inside the stroke at which the lever arm is at least so long.

        Args:
            least_lever: Shortest admissible |dx/dw|, m/rad.

        Returns:
            Lowest and highest coordinate, rad.

        Raises:
            InvalidInputError: the lever is nowhere so long. Its largest value is that of the shorter of a and b.
        """
        if not 0 <= least_lever < min(self.a, self.b):
            raise InvalidInputError(
                f"{self.name}: a lever arm lies between 0 and {min(self.a, self.b):g} m: got {least_lever:g} m; "
                "ask for less"
            )
        # the lever is the triangle's height over the actuator: it parts the length into the feet of a and b
        across, along = math.sqrt(self.a**2 - least_lever**2), math.sqrt(self.b**2 - least_lever**2)
        shortest, longest = max(abs(across - along), self.dead), min(across + along, self.dead + self.stroke)
        if not shortest < longest:
            raise InvalidInputError(
                f"{self.name}: no stroke from 0 to {self.stroke:g} m has a lever arm of {least_lever:g} m; ask for less"
            )
        ends = [float(self.coordinate(length - self.dead)) for length in (shortest, longest)]
        return min(ends), max(ends)


#: Longest extension of the telescope, m.
TELESCOPE = 1.1
#: Joint of the lift in the plane; then the next joint, and the tool at telescope 0, each in the frame before it, m.
BASE, ELBOW, TOOL = (-0.189261, 0.85), (1.59687, 0.100002), (1.99949, 0.154167)
#: Directions of the pins on the lift link and on the tilt link below their x-axes, and of the tilt's base pin seen from
#: its joint, rad.
_LIFT_PIN, _TILT_PIN = math.atan2(45.757, 373.313), math.atan2(88.061, 296.198)
_TILT_BASE = math.atan2(139.50, 1132.19)
#: Base pins: of the lift in the plane, of the tilt in the frame of the lift link, m.
LIFT_BASE = (0.185, -0.085)
TILT_BASE = (ELBOW[0] - 1.13218582 * math.cos(_TILT_BASE), ELBOW[1] - 1.13218582 * math.sin(_TILT_BASE))


def _loop(name: str, joint: tuple[float, float], base: tuple[float, float], b: float, below: float) -> ActuatorLoop:
    """The triangle of an actuator, base pin to a pin at distance b from a joint, so far below the link's x-axis."""
    towards = math.atan2(base[1] - joint[1], base[0] - joint[0])
    offset = (-below - towards) % (2 * math.pi) - math.pi
    return ActuatorLoop(name=name, a=math.dist(base, joint), b=b, dead=0.83, stroke=0.59, offset=offset)


LIFT = _loop("lift", BASE, LIFT_BASE, 0.37610632, _LIFT_PIN)
TILT = _loop("tilt", ELBOW, TILT_BASE, 0.30901133, _TILT_PIN)


def tool(w: Any) -> tuple[Any, Any]:
    """Horizontal and vertical position of the tool, m, at joint coordinates (w1, w2, w3)."""
    import casadi as ca

    c1, s1, c2, s2 = ca.cos(w[0]), ca.sin(w[0]), ca.cos(w[1]), ca.sin(w[1])
    c12, s12 = c1 * c2 - s1 * s2, s1 * c2 + c1 * s2
    reach = TOOL[0] + w[2]
    across = BASE[0] + ELBOW[0] * c1 - ELBOW[1] * s1 + reach * c12 - TOOL[1] * s12
    up = BASE[1] + ELBOW[0] * s1 + ELBOW[1] * c1 + reach * s12 + TOOL[1] * c12
    return across, up


def figure(w: Any) -> Any:
    """Points of the crane as sticks, m, at joint coordinates: ground, lift, tilt, corner, tool. Shape (3, 5)."""
    import casadi as ca

    c1, s1 = ca.cos(w[0]), ca.sin(w[0])
    elbow = BASE[0] + ELBOW[0] * c1 - ELBOW[1] * s1, BASE[1] + ELBOW[0] * s1 + ELBOW[1] * c1
    c12, s12 = ca.cos(w[0] + w[1]), ca.sin(w[0] + w[1])
    corner = elbow[0] - TOOL[1] * s12, elbow[1] + TOOL[1] * c12
    points = ((BASE[0], 0.0), BASE, elbow, corner, tool(w))
    return ca.horzcat(*(ca.vertcat(across, 0, up) for across, up in points))


def apart(w: Any, place: Sequence[float]) -> float:
    """Distance of the tool from a place at joint coordinates, m."""
    return math.hypot(*(float(is_at) - float(there) for is_at, there in zip(tool(w), place, strict=True)))


def reach(place: Sequence[float], extension: float, near: Any) -> NDArray[np.float64] | None:
    """Joint coordinates at which the tool is at a place, with a given extension of the telescope.

    Args:
        place: Horizontal and vertical position of the tool, m.
        extension: Extension of the telescope, m.
        near: Joint coordinates from which Newton's method starts; it chooses between elbow up and down.

    Returns:
        Coordinates, shape (3,), whether or not they are inside the ranges of the joints; None where the method does
        not converge.
    """
    import numpy as np

    angles = np.array(near[:2], dtype=float)
    for _ in range(50):
        value, slope = (np.array(part) for part in _step()(angles, extension, [*place]))
        if np.abs(value).max() < 1e-12:
            return np.append(angles, extension)
        change = np.linalg.lstsq(slope, value, rcond=None)[0].ravel()
        angles = angles - change * min(1.0, 0.5 / max(np.abs(change).max(), 1e-12))
    return None


@cache
def _step() -> Any:
    """CasADi function of the two angles, the extension and a place: how far the tool is off, and its Jacobian."""
    import casadi as ca

    w, extension, place = ca.SX.sym("w", 2), ca.SX.sym("w3"), ca.SX.sym("place", 2)
    residual = ca.vertcat(*tool(ca.vertcat(w, extension))) - place
    return ca.Function("step", [w, extension, place], [residual, ca.jacobian(residual, w)])
