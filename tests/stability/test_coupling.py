"""Loads of coupled joints against sampling, and tangents over many boxes against differences."""

from itertools import pairwise

import casadi as ca
import numpy as np
import pytest

from stability import Interval, algebraic, enclose, tangents_many
from stability.enclosures.translation import straight_line
from stability.networks.coupling import Loads, Slices, Tube

NAMES = ("x0", "x1", "v0", "v1", "a0", "a1", "payload")


def pendulums():
    """Two joints of an arm in a vertical plane, by hand: masses at the ends of unit rods."""
    z = ca.SX.sym("z", 7)
    x, v, a, p = z[:2], z[2:4], z[4:6], z[6]
    low, high, g = 3.0, 2.0 + p, 9.81
    across, both = ca.cos(x[1]), x[0] + x[1]
    m11, m12, m22 = low + high * (2 + 2 * across), high * (1 + across), high
    swirl = high * ca.sin(x[1])
    first = m11 * a[0] + m12 * a[1] - swirl * (2 * v[0] * v[1] + v[1] ** 2)
    first += g * ((low + high) * ca.cos(x[0]) + high * ca.cos(both))
    second = m12 * a[0] + m22 * a[1] + swirl * v[0] ** 2 + g * high * ca.cos(both)
    return ca.Function("forces", [z], [ca.vertcat(first, second)])


EXPRESSION = straight_line(pendulums(), NAMES)
LOADS = Loads(
    expression=EXPRESSION, own=(8.0, 2.2), disturbances={"payload": Interval(0.0, 0.5)}, first=("position", "position")
)
MIDDLE = LOADS.middle["payload"]


def motion(slices=40):
    """Two joints on sines over a second: position … jerk."""
    t = np.linspace(0, 1, slices + 1)
    fine = np.array([np.linspace(a, b, 60) for a, b in pairwise(t)])
    w = 2.0
    curves = [np.stack([0.3 * np.sin(w * fine), 0.5 + 0.2 * np.cos(w * fine)])]
    for _ in range(3):
        k = len(curves)
        phase = k * np.pi / 2
        curves.append(w**k * np.stack([0.3 * np.sin(w * fine + phase), 0.2 * np.cos(w * fine + phase)]))
    values = np.stack(curves)
    room = 1e-3 * np.abs(values).max(axis=(2, 3), keepdims=True)[..., 0]
    return values, Slices(low=values.min(axis=3) - room, high=values.max(axis=3) + room)


@pytest.mark.parametrize("seed", range(4))
def test_loads_stay_inside_what_is_foreseen_and_its_surprise(seed):
    random = np.random.default_rng(seed)
    values, slices = motion()
    tubes = (Tube(position=0.02, speed=0.1, acceleration=0.5), Tube(position=0.01, speed=0.2, acceleration=1.0))
    foreseen = LOADS.feedforward(slices)
    sizes, inertia = LOADS.deviation(slices, tubes)
    worst = np.zeros(2)
    for _ in range(400):
        k, i = random.integers(values.shape[2]), random.integers(values.shape[3])
        at = values[:3, :, k, i]
        half_widths = np.array([[t.position, t.speed, t.acceleration] for t in tubes]).T
        moved = at + half_widths * random.choice((-1.0, 1.0), at.shape)
        load = np.array(EXPRESSION(dict(zip(NAMES, [*at.ravel(), MIDDLE], strict=True)))) - at[2] * LOADS.own
        real = np.array(EXPRESSION(dict(zip(NAMES, [*moved.ravel(), random.choice((0.0, 0.5))], strict=True))))
        real = real - moved[2] * LOADS.own
        assert all(known.low <= value <= known.high for (known, _), value in zip(foreseen, load, strict=True))
        worst = np.maximum(worst, np.abs(real - load))
    assert (worst <= sizes).all() and (worst > 0.5 * np.array(sizes)).all()
    assert inertia[0, 1] >= 2.5 * (1 + np.cos(0.7)) - 1e-9


def test_the_rate_of_a_foreseen_load_holds_its_differences():
    values, slices = motion()
    foreseen = LOADS.feedforward(slices)
    flat = values.transpose(0, 1, 2, 3).reshape(4, 2, -1)
    loads = np.array([
        np.array(EXPRESSION(dict(zip(NAMES, [*flat[:3, :, k].ravel(), MIDDLE], strict=True))))
        - flat[2, :, k] * LOADS.own
        for k in range(60)
    ])  # fmt: skip
    step = 1 / 40 / 59
    for i, (_, rate) in enumerate(foreseen):
        slopes = np.diff(loads[:, i]) / step
        assert rate.low <= slopes.min() and slopes.max() <= rate.high


@pytest.mark.parametrize("seed", range(3))
def test_tangents_hold_differences(seed):
    random = np.random.default_rng(seed)
    low = random.uniform(0.1, 0.6, (7, 20))
    ranges = {name: (low[k], low[k] + 0.05) for k, name in enumerate(NAMES)}
    one = (np.ones(20), np.ones(20))
    along = tangents_many(EXPRESSION, ranges, {name: {name: one} for name in NAMES})
    for _ in range(20):
        at = low + 0.05 * random.random(low.shape)
        for k, name in enumerate(NAMES):
            nudge = np.zeros(7)
            nudge[k] = 1e-6
            for box in range(0, 20, 5):
                ends = [np.array(EXPRESSION(dict(zip(NAMES, at[:, box] + s * nudge, strict=True)))) for s in (1, -1)]
                slope = (ends[0] - ends[1]) / 2e-6
                for i in range(2):
                    bounds = along[i].get(name, (np.zeros(20), np.zeros(20)))
                    assert bounds[0][box] - 1e-6 <= slope[i] <= bounds[1][box] + 1e-6


def test_a_tangent_of_what_cannot_be_differentiated_is_refused():
    x = ca.SX.sym("x")
    program = straight_line(ca.Function("f", [x], [ca.fabs(x)]), ("x",))
    with pytest.raises(NotImplementedError, match="abs"):
        tangents_many(program, {"x": (np.zeros(1), np.ones(1))}, {"x": {"t": (np.ones(1), np.ones(1))}})


@pytest.mark.parametrize("seed", range(3))
def test_angles_of_actuators_become_square_roots(seed):
    u = ca.SX.sym("u", 2)
    first, second = -ca.acos(u[0]) - 0.4, 0.3 + ca.acos(u[1] * u[0])
    value = ca.vertcat(ca.cos(first) * ca.sin(second), ca.sin(first + 0.1), ca.cos(0.2 - second))
    program = straight_line(ca.Function("f", [u], [value]), ("p", "q"))
    plain = algebraic(program)
    assert not {"acos", "sin", "cos"} & {operation[0] for operation in plain.operations}
    at = dict(zip(("p", "q"), np.random.default_rng(seed).uniform(-0.9, 0.9, 2), strict=True))
    exact = [
        np.cos(-np.arccos(at["p"]) - 0.4) * np.sin(0.3 + np.arccos(at["p"] * at["q"])),
        np.sin(-np.arccos(at["p"]) - 0.3),
        np.cos(-0.1 - np.arccos(at["p"] * at["q"])),
    ]
    np.testing.assert_allclose(plain(at), exact, atol=1e-14)
    boxes = enclose(plain, {name: Interval(value) for name, value in at.items()})
    assert all(box.low <= value <= box.high + 1e-15 for box, value in zip(boxes, plain(at), strict=True))


def test_an_angle_that_is_used_otherwise_is_refused():
    u = ca.SX.sym("u")
    for value in (ca.acos(u), ca.acos(u) * 2, ca.acos(u) + u):
        with pytest.raises(ValueError, match="sines and cosines alone"):
            algebraic(straight_line(ca.Function("f", [u], [value]), ("u",)))


def test_a_load_that_does_not_depend_on_the_motion_has_no_rate():
    """Only a disturbance, constant or not: foreseen at its middle, half its range away at most."""
    z = ca.SX.sym("z", 4)
    program = straight_line(ca.Function("f", [z], [z[3]]), ("x0", "v0", "a0", "load"))
    loads = Loads(expression=program, own=(0.0,), disturbances={"load": Interval(2.0, 6.0)}, first=("position",))
    slices = Slices(low=np.zeros((4, 1, 3)), high=np.ones((4, 1, 3)))
    ((load, rate),) = loads.feedforward(slices)
    assert load.low <= 4.0 <= load.high and load.high - load.low < 1e-7 and rate.magnitude < 1e-300
    (size,), _ = loads.deviation(slices, [Tube(position=1.0, speed=1.0, acceleration=1.0)])
    assert size == pytest.approx(2.0)


def test_a_member_whose_first_state_is_a_speed_has_no_position():
    """w = 3 a + 2 v + d along r0 = speed, r1 = acceleration."""
    z = ca.SX.sym("z", 4)
    program = straight_line(ca.Function("f", [z], [3 * z[2] + 2 * z[1] + z[3]]), ("x0", "v0", "a0", "d"))
    loads = Loads(expression=program, own=(1.0,), disturbances={"d": Interval(-1.0, 1.0)}, first=("speed",))
    assert [name for name, _, _ in loads.signals()] == ["v0", "a0"]
    slices = Slices(
        low=np.array([[[1.0]], [[0.5]], [[0.0]], [[0.0]]]), high=np.array([[[1.0]], [[0.5]], [[0.0]], [[0.0]]])
    )
    ((load, rate),) = loads.feedforward(slices)
    assert (load.low + load.high) / 2 == pytest.approx(2 * 1.0 + (3 - 1) * 0.5)
    assert (rate.low + rate.high) / 2 == pytest.approx(2 * 0.5 / 2)  # its hull with rest
    (size,), inertia = loads.deviation(slices, [Tube(position=0.0, speed=0.1, acceleration=0.2)])
    assert size == pytest.approx(2 * 0.1 + 2 * 0.2 + 1.0) and inertia[0, 0] == pytest.approx(2.0)
