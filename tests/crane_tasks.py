"""Random tasks of the crane that a machine of its class can be asked for."""

import numpy as np

from hdmm_opt.machines.crane_limits import joint_limits
from hdmm_opt.motions.crane_task import crane_cost, crane_task, tool_function
from trajectories import Waypoint
from trajectories.diagnosis import at_rest
from trajectories.obstacle import Ball, HalfSpace

#: Payloads, kg: a few, so that the functions of equal tasks are shared.
PAYLOADS = (0.0, 60.0, 120.0)
GROUND = HalfSpace(name="ground", normal=(0.0, -1.0), offset=2.0)


def place(random, payload):
    """Joint coordinates, inside the ranges by 2 %, at which the drives hold the payload."""
    low, high = joint_limits().position
    while True:
        w = random.uniform(low + 0.02 * (high - low), high - 0.02 * (high - low))
        if not at_rest(crane_task([w, low], payload=payload), w) and tool_function()(w)[1] > -1.9:
            return w


def random_task(seed):
    """Point to point, by way of a place, to a place of the tool, past a ball, or with a cost beside time."""
    random = np.random.default_rng(seed)
    payload = float(random.choice(PAYLOADS))
    kind = ("plain", "via", "tool", "ultimate", "cost")[seed % 5]
    start, goal = place(random, payload), place(random, payload)
    given = {"payload": payload}
    if kind == "via":
        return crane_task([start, place(random, payload), goal], **given)
    if kind == "tool":
        there = np.array(tool_function()(goal)).ravel()
        return crane_task([start, Waypoint(value=there, through=tool_function(), near=goal)], **given)
    if kind == "ultimate":
        ends = [np.array(tool_function()(w)).ravel() for w in (start, goal)]
        middle = np.array(tool_function()((start + goal) / 2)).ravel() + random.normal(0, 0.2, 2)
        radius = min(0.35, 0.7 * min(np.hypot(*(middle - end)) for end in ends))
        return crane_task(
            [start, goal], obstacles=[Ball(name="post", centre=tuple(middle), radius=radius), GROUND], **given
        )
    if kind == "cost":
        return crane_task([start, goal], cost=crane_cost(time=1.0, effort=0.5, payload=payload), **given)
    return crane_task([start, goal], **given)


def excess(task, motion, points=4001):
    """How far a solved motion is outside a limit on a fine grid, relative; not positive where all is inside."""
    times = np.linspace(motion.spline.start, motion.spline.end, points)
    shares = []
    for order in (1, 2, 3):
        shares.append((np.abs(motion.spline(times, order)) / task.limits.of(order)).max() - 1)
    low, high = task.limits.room
    where = motion.spline(times)
    shares.append(max((low - where).max(), (where - high).max()))
    q = task.quantities
    values = q.values(motion.spline, times)
    shares.append(
        max(
            ((values - q.upper[:, None]) / q.scale[:, None]).max(),
            ((q.lower[:, None] - values) / q.scale[:, None]).max(),
        )
    )
    return max(shares)
