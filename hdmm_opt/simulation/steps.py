"""Integration steps in a tick, from the time constants of the plants."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from ..plants import Plant

#: Longest integration step as a share of the fastest time constant.
STEP_SHARE = 0.35
#: Longest integration step, s: between the control instants a loop is looked at this often.
LONGEST = 5e-4


def steps_of(plant: Plant, period: float, disturbances: Sequence[float]) -> int:
    """Integration steps in one tick, from the fastest time constant of a plant at its operating point.

    Args:
        plant: The plant, at nominal parameters.
        period: Duration of a tick, s.
        disturbances: Its disturbances there.
    """
    import casadi as ca

    jacobian = ca.Function("J", [plant.x, plant.u, plant.w, plant.p], [ca.jacobian(plant.rate, plant.x)])
    values = list(plant.values().values())
    at_work = np.array(jacobian(list(plant.operating), 0, list(disturbances), values))
    fastest = float(np.abs(np.linalg.eigvals(at_work)).max())
    return max(math.ceil(period / LONGEST - 1e-9), math.ceil(period * fastest / STEP_SHARE))
