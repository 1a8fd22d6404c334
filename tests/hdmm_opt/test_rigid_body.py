"""Rigid bodies from URDF against Pinocchio, and the conservation of energy."""

import casadi as ca
import numpy as np
import pinocchio
import pytest

from hdmm_opt.errors import InvalidInputError
from hdmm_opt.machines.rigid_body import GRAVITY, Payload, inverse_dynamics, mass_matrix, pose
from hdmm_opt.machines.urdf import bodies


def vector(values):
    return " ".join(repr(float(v)) for v in values)


def inertial(random):
    spread = random.uniform(0.05, 1.0, 3)
    turn = np.linalg.qr(random.normal(size=(3, 3)))[0]
    m = turn @ np.diag([spread[1] + spread[2], spread[0] + spread[2], spread[0] + spread[1]]) @ turn.T
    return (
        f'<inertial><origin xyz="{vector(random.normal(size=3))}" rpy="{vector(random.uniform(-3, 3, 3))}"/>'
        f'<mass value="{float(random.uniform(0.5, 50))!r}"/><inertia ixx="{float(m[0, 0])!r}" ixy="{float(m[0, 1])!r}" ixz="{float(m[0, 2])!r}" '
        f'iyy="{float(m[1, 1])!r}" iyz="{float(m[1, 2])!r}" izz="{float(m[2, 2])!r}"/></inertial>'
    )


def random_urdf(seed, joints):
    """A tree with revolute, continuous, prismatic and fixed joints in random places."""
    random = np.random.default_rng(seed)
    links, made = ['<link name="l0"/>'], []
    for k in range(1, joints + 1):
        kind = str(random.choice(["revolute", "continuous", "prismatic", "fixed"])) if k > 1 else "revolute"
        parent = int(random.integers(max(0, k - 3), k))
        links.append(f'<link name="l{k}">{inertial(random)}</link>')
        made.append(
            f'<joint name="j{k}" type="{kind}"><parent link="l{parent}"/><child link="l{k}"/>'
            f'<origin xyz="{vector(random.normal(size=3))}" rpy="{vector(random.uniform(-3, 3, 3))}"/>'
            f'<axis xyz="{vector(random.normal(size=3))}"/><limit lower="-2" upper="2" effort="1" velocity="1"/></joint>'
        )
    return f'<robot name="r">{"".join(links)}{"".join(made)}</robot>'


def oracle(text, names, q, v, a):
    """Torques, mass matrix and the last body's place by Pinocchio, in our order of joints."""
    model = pinocchio.buildModelFromXML(text)
    data = model.createData()
    model.gravity.linear = np.array(GRAVITY)
    position, rate, gain = pinocchio.neutral(model), np.zeros(model.nv), np.zeros(model.nv)
    rows = []
    for k, name in enumerate(names):
        joint = model.joints[model.getJointId(name)]
        rows.append(joint.idx_v)
        rate[joint.idx_v], gain[joint.idx_v] = v[k], a[k]
        if joint.nq == 2:
            position[joint.idx_q : joint.idx_q + 2] = np.cos(q[k]), np.sin(q[k])
        else:
            position[joint.idx_q] = q[k]
    torque = pinocchio.rnea(model, data, position, rate, gain)[rows]
    mass = pinocchio.crba(model, data, position)
    mass = np.triu(mass) + np.triu(mass, 1).T
    pinocchio.forwardKinematics(model, data, position)
    place = data.oMi[model.getJointId(names[-1])]
    return torque, mass[np.ix_(rows, rows)], place.rotation, place.translation


@pytest.mark.parametrize("seed", range(12))
def test_agrees_with_pinocchio_on_random_trees(seed):
    text = random_urdf(seed, 2 + seed % 7)
    tree = bodies(text)
    random = np.random.default_rng(seed + 100)
    q, v, a = random.uniform(-2, 2, (3, len(tree)))
    torque, mass, rotation, origin = oracle(text, [b.joint for b in tree], q, v, a)
    found = np.array(ca.DM(inverse_dynamics(tree, q, v, a))).ravel()
    assert found == pytest.approx(torque, rel=1e-10, abs=1e-9)
    symbol = ca.SX.sym("q", len(tree))
    matrix = np.array(ca.Function("M", [symbol], [mass_matrix(tree, symbol)])(q))
    assert matrix == pytest.approx(mass, rel=1e-10, abs=1e-9) and np.linalg.eigvalsh(matrix)[0] > 0
    ours = pose(tree, q, len(tree) - 1)
    assert np.array(ca.DM(ours[0])) == pytest.approx(rotation, abs=1e-12)
    assert np.array(ca.DM(ours[1])).ravel() == pytest.approx(origin, abs=1e-12)


def test_a_payload_is_a_point_mass_fixed_to_its_body():
    text = random_urdf(5, 4)
    tree = bodies(text)
    last, place = len(tree) - 1, [0.3, -0.2, 0.5]
    link = tree[last].joint.replace("j", "l")
    heavier = text.replace(
        "</robot>",
        '<link name="load"><inertial><mass value="7"/><inertia ixx="0" iyy="0" izz="0" ixy="0" ixz="0" iyz="0"/></inertial>'
        f'</link><joint name="hook" type="fixed"><parent link="{link}"/><child link="load"/>'
        f'<origin xyz="{vector(place)}"/></joint></robot>',
    )
    q, v, a = np.random.default_rng(2).normal(size=(3, len(tree)))
    given = inverse_dynamics(tree, q, v, a, payloads=[Payload(body=last, mass=7.0, position=place)])
    assert np.array(ca.DM(given)) == pytest.approx(np.array(ca.DM(inverse_dynamics(bodies(heavier), q, v, a))))


def test_energy_is_conserved_in_free_motion():
    """No torque: kinetic and potential energy exchange, their sum stays; its rate is the power of the torques."""
    tree = bodies(random_urdf(3, 4))
    n = len(tree)
    q, v, a, height = ca.SX.sym("q", n), ca.SX.sym("v", n), ca.SX.sym("a", n), 0
    for i, body in enumerate(tree):
        rotation, origin = pose(tree, q, i)
        height -= ca.dot(ca.DM(list(GRAVITY)), body.mass * origin + rotation @ ca.DM(body.moment))
    energy = 0.5 * v.T @ mass_matrix(tree, q) @ v + height
    rate = ca.jtimes(energy, ca.vertcat(q, v), ca.vertcat(v, a))
    power = ca.dot(inverse_dynamics(tree, q, v, a), v)
    both = ca.Function("P", [q, v, a], [rate, power])
    random = np.random.default_rng(0)
    for _ in range(20):
        seen = [float(x) for x in both(*random.normal(size=(3, n)))]
        assert seen[0] == pytest.approx(seen[1], rel=1e-9, abs=1e-8)


def test_fixed_links_and_the_ground_count_as_they_should():
    text = random_urdf(8, 6)
    tree = bodies(text)
    assert all(body.parent < i for i, body in enumerate(tree)) and len({b.joint for b in tree}) == len(tree)
    assert bodies('<robot name="r"><link name="only"/></robot>') == ()


LINK = '<link name="b"><inertial><mass value="1"/><inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial></link>'
JOINT = '<joint name="j" type="revolute"><parent link="a"/><child link="b"/></joint>'


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("<robot", "not valid XML"),
        ('<robot><link name="a"/><link name="c"/></robot>', "one root link"),
        (f'<robot><link name="a"/>{LINK}{JOINT.replace("revolute", "floating")}</robot>', "is floating"),
        (f'<robot><link name="a"/>{LINK}{JOINT.replace(chr(34) + "b", chr(34) + "z")}</robot>', "must be a link: got z"),
        (f'<robot><link name="a"/>{LINK.replace("value=" + chr(34) + "1", "value=" + chr(34) + "-1")}{JOINT}</robot>', "no rigid body"),
        (f'<robot><link name="a"/>{LINK.replace("ixx=" + chr(34) + "1", "ixx=" + chr(34) + "3")}{JOINT}</robot>', "above the sum"),
        (f'<robot><link name="a"/>{LINK.replace("value=" + chr(34) + "1", "value=" + chr(34) + "x")}{JOINT}</robot>', "finite number"),
        (f'<robot><link name="a"/><link name="b"/>{JOINT}</robot>', "needs a mass"),
        (f'<robot><link name="a"/>{LINK}{JOINT.replace("</joint>", "<axis xyz=" + chr(34) + "0 0 0" + chr(34) + "/></joint>")}</robot>', "no direction"),
        (f'<robot><link name="a"/>{LINK}{JOINT.replace("</joint>", "<origin xyz=" + chr(34) + "0 0" + chr(34) + "/></joint>")}</robot>', "three finite"),
        (f'<robot><link name="a"/>{LINK}{JOINT}{JOINT}</robot>', "hangs on two"),
    ],
)  # fmt: skip
def test_a_bad_file_is_refused_in_one_line(text, said):
    with pytest.raises(InvalidInputError, match=said) as caught:
        bodies(text)
    assert "\n" not in str(caught.value)
