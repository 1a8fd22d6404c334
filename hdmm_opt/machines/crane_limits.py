"""Limits of the crane's joints in a motion, and what a motion can be asked to save."""

from __future__ import annotations

import numpy as np

from trajectories import MotionLimits

from .crane_dynamics import JOINTS
from .crane_geometry import LIFT, TELESCOPE, TILT

#: Shortest lever arm of the actuators of lift and tilt that a motion may use, m/rad; assumed.
LEAST_LEVER = 0.08
#: Largest rates, accelerations and jerks of lift, tilt (rad) and telescope (m); assumed.
SPEED, ACCELERATION, JERK = (0.5, 0.6, 0.13), (0.8, 0.8, 0.5), (8.0, 8.0, 5.0)
UNITS = ("rad", "rad", "m")
#: Running costs of a motion: electrical energy drawn, what is lost of it, sum of squared shares of the torque limits.
COSTS = ("energy", "loss", "effort")


def joint_limits(least_lever: float = LEAST_LEVER) -> MotionLimits:
    """Ranges of the joints inside stroke and away from the singularity, and their largest derivatives."""
    ends = (LIFT.usable(least_lever), TILT.usable(least_lever), (0.0, TELESCOPE))
    return MotionLimits(
        position=(np.array([low for low, _ in ends]), np.array([high for _, high in ends])),
        speed=np.array(SPEED), acceleration=np.array(ACCELERATION), jerk=np.array(JERK),
        names=JOINTS, units=UNITS,
    )  # fmt: skip
