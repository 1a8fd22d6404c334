"""Tasks of the crane: bounds along a motion, limits of the drives, and random tasks."""

import casadi as ca
import numpy as np
import pytest
from crane_tasks import GROUND, excess, place, random_task

from hdmm_opt.errors import InvalidInputError
from hdmm_opt.machines.crane_geometry import LIFT, TILT
from hdmm_opt.machines.crane_limits import joint_limits
from hdmm_opt.motions.crane_task import crane_cost, crane_task, drive_quantities, tool_function
from hdmm_opt.motions.enclosure import enclosure
from trajectories import LimitViolatedError, Spline, Waypoint, pieces, solve
from trajectories.spline import clamped_knots

START, GOAL = [0.9, -0.8, 0.2], [0.2, -1.2, 0.6]


def wiggle(seed, count=3):
    """A motion without purpose inside the ranges of the joints."""
    random = np.random.default_rng(seed)
    low, high = joint_limits().position
    points = random.uniform(low + 0.2 * (high - low), high - 0.2 * (high - low), (12, count))
    return Spline(knots=clamped_knots(0.0, 20.0, 7), coefficients=points)


@pytest.mark.parametrize("seed", range(3))
def test_bounds_hold_the_quantities_and_close_in_on_them(seed):
    spline, quantities = wiggle(seed), drive_quantities(60.0, (GROUND,))
    work = pieces(spline)
    widths = []
    for _ in range(6):
        low, high = quantities.enclose(work)
        times = work.start[:, None] + work.width[:, None] * np.linspace(0.0, 1.0, 9)
        values = quantities.values(spline, times.ravel()).reshape(len(quantities.names), *times.shape)
        room = 1e-9 * quantities.scale[:, None]
        assert (values.min(axis=2) >= low - room).all() and (values.max(axis=2) <= high + room).all()
        widths.append(np.maximum(high - values.max(axis=2), 0.0).max(axis=1) / quantities.scale)
        work = work.halved()
    smooth = [
        i for i, name in enumerate(quantities.names) if name.endswith(("force", "motor speed")) or "ground" in name
    ]
    # second order: once the pieces are short, half the width leaves a quarter of the excess
    assert (widths[-1][smooth] < 0.35 * widths[-2][smooth] + 1e-9).all()


def test_a_function_of_other_shapes_is_refused():
    for lengths in ((2, 3, 2, 2), (2, 2, 2)):
        inputs = [ca.SX.sym(f"x{k}", length) for k, length in enumerate(lengths)]
        with pytest.raises(ValueError, match="of one shape"):
            enclosure(ca.Function("f", inputs, [inputs[0][0]]))


def test_a_motion_of_the_crane_is_inside_every_limit():
    task = crane_task([START, GOAL], payload=60.0)
    motion = solve(task)
    assert excess(task, motion, points=10_000) <= 0.0
    assert motion.peaks.inside and (motion.peaks.upper <= task.quantities.upper).all()
    binding = motion.peaks.upper / task.quantities.upper
    assert binding.max() > 0.95
    for loop, k in ((LIFT, 0), (TILT, 1)):
        angles = motion.spline(np.linspace(0, motion.spline.end, 500))[:, k]
        strokes = np.array([float(loop.extension(w)) for w in angles])
        assert strokes.min() >= 0 and strokes.max() <= min(loop.stroke, loop.singular_stroke)


def test_effort_and_time_are_traded():
    quick = solve(crane_task([START, GOAL], cost=crane_cost(time=1.0)))
    easy = solve(crane_task([START, GOAL], cost=crane_cost(time=0.0, effort=1.0), duration=1.5 * quick.cost))
    both = solve(crane_task([START, GOAL], cost=crane_cost(time=1.0, effort=5.0)))
    assert quick.parts["time"] <= both.parts["time"] <= easy.parts["time"] * (1 + 1e-6)
    assert both.cost <= quick.parts["time"] + 5.0 * quick.parts["effort"]
    with pytest.raises(InvalidInputError, match="costs are time, jerk, energy"):
        crane_cost(power=1.0)


def test_what_the_machine_cannot_do_is_said_with_the_limit():
    with pytest.raises(
        LimitViolatedError, match=r"at rest at the goal, lift force is .* N, its limit 75000 N less 0\.02 %"
    ):
        solve(crane_task([GOAL, [0.9, -0.8, 1.0]], payload=30.0))
    with pytest.raises(LimitViolatedError, match="lift position 2 rad leaves the stroke"):
        solve(crane_task([START, [2.0, -0.8, 0.2]]))
    with pytest.raises(LimitViolatedError, match=r"limits: with the limits as they are, [\d.]+ s would do; telescope"):
        solve(crane_task([START, GOAL], longest=2.0))


def test_the_tool_is_taken_to_a_place():
    there = np.array(tool_function()(GOAL)).ravel()
    motion = solve(crane_task([START, Waypoint(value=there, through=tool_function(), near=np.array(GOAL))]))
    assert np.array(tool_function()(motion.spline.coefficients[-1])).ravel() == pytest.approx(there, abs=1e-6)
    assert motion.cost < solve(crane_task([START, GOAL])).cost


def check(seeds):
    solved = 0
    for seed in seeds:
        task = random_task(seed)
        try:
            motion = solve(task)
        except LimitViolatedError as refusal:
            assert "its limit" in str(refusal) or "would do" in str(refusal)
            continue
        assert excess(task, motion) <= 0.0 and motion.peaks.inside
        solved += 1
    return solved


@pytest.mark.parametrize("first", range(0, 100, 50))
def test_random_tasks_are_solved_inside_every_limit(first):
    """Two of every 50; all hundred are solved with the long tests."""
    assert check(range(first + first // 25, first + 25, 13)) >= 1


@pytest.mark.long
def test_a_hundred_random_tasks():
    assert check(range(100)) >= 98


def test_random_places_can_be_held():
    random = np.random.default_rng(0)
    low, high = joint_limits().position
    for _ in range(5):
        w = place(random, 120.0)
        assert (w > low).all() and (w < high).all()
