"""The crane's geometry: closed forms, autodiff, virtual work, and the same chain as rigid bodies."""

import casadi as ca
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from hdmm_opt.errors import InvalidInputError
from hdmm_opt.machines.crane_geometry import BASE, ELBOW, LIFT, TELESCOPE, TILT, TOOL, tool
from hdmm_opt.machines.rigid_body import pose
from hdmm_opt.machines.urdf import bodies


@pytest.mark.parametrize("loop", [LIFT, TILT])
@given(share=st.floats(0.001, 0.9))
def test_stroke_and_angle_are_inverse_and_the_lever_is_the_derivative(loop, share):
    x = share * min(loop.stroke, loop.singular_stroke)
    w = float(loop.coordinate(x))
    assert float(loop.extension(w)) == pytest.approx(x, abs=1e-9)
    symbol = ca.SX.sym("w")
    slope = ca.Function("s", [symbol], [ca.jacobian(loop.extension(symbol), symbol)])
    assert float(loop.lever(w)) == pytest.approx(float(slope(w)), rel=1e-9)
    # area of the triangle: lever × length / 2, and a b sin(angle between them) / 2
    assert abs(float(loop.lever(w))) * (x + loop.dead) == pytest.approx(loop.a * loop.b * abs(np.sin(w + loop.offset)))


def test_the_ranges_are_those_of_the_machine():
    assert LIFT.singular_stroke == pytest.approx(0.553, abs=5e-4) and LIFT.singular_stroke < LIFT.stroke
    assert np.degrees(float(LIFT.coordinate(0.0))) == pytest.approx(-9.2, abs=0.1)
    tilt = np.degrees([float(TILT.coordinate(x)) for x in (0.0, TILT.stroke)])
    assert tilt == pytest.approx([-146.1, -0.4], abs=0.1)


@pytest.mark.parametrize("loop", [LIFT, TILT])
def test_the_usable_range_keeps_its_lever(loop):
    for least in (0.02, 0.1, 0.2):
        low, high = loop.usable(least)
        w = np.linspace(low, high, 500)
        levers = np.abs(np.array(ca.DM(loop.lever(ca.DM(w)))).ravel())
        strokes = np.array(ca.DM(loop.extension(ca.DM(w)))).ravel()
        assert levers.min() >= least - 1e-9
        assert strokes.min() >= -1e-9 and strokes.max() <= min(loop.stroke, loop.singular_stroke) + 1e-9
        outside = [w[0] - 1e-3, w[-1] + 1e-3]
        for angle in outside:
            x = float(loop.extension(angle))
            assert abs(float(loop.lever(angle))) < least or not 0 <= x <= loop.stroke
    with pytest.raises(InvalidInputError, match="a lever arm lies between"):
        loop.usable(0.5)


def test_the_tool_is_where_the_chain_of_bodies_ends():
    """The same crane as a URDF in the x-z plane, its last joint the telescope."""
    mass = '<inertial><mass value="1"/><inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial>'
    joints = (
        ("lift", "revolute", "0 -1 0", BASE),
        ("tilt", "revolute", "0 -1 0", ELBOW),
        ("telescope", "prismatic", "1 0 0", TOOL),
    )
    text = '<robot name="crane"><link name="l0"/>'
    for k, (name, kind, axis, (x, z)) in enumerate(joints):
        text += (
            f'<link name="l{k + 1}">{mass}</link><joint name="{name}" type="{kind}"><parent link="l{k}"/><child link="l{k + 1}"/>'
            f'<origin xyz="{x} 0 {z}"/><axis xyz="{axis}"/></joint>'
        )
    tree = bodies(text + "</robot>")
    for w in np.random.default_rng(4).uniform([-0.2, -2.5, 0], [1.2, 0, TELESCOPE], (20, 3)):
        _, origin = pose(tree, w, 2)
        across, up = tool(w)
        assert np.array(ca.DM(origin)).ravel() == pytest.approx([float(across), 0.0, float(up)], abs=1e-12)
