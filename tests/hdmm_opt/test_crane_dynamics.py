"""The crane's closed chain against Pinocchio's and MuJoCo's, and the balance of power."""

from pathlib import Path

import casadi as ca
import mujoco
import numpy as np
import pinocchio
import pytest

import hdmm_opt.machines
from hdmm_opt.machines.crane_dynamics import (
    DAMPING,
    bodies_of_crane,
    chain,
    drives,
    joint_torques,
    levers,
    rod_forces,
    strokes,
)
from hdmm_opt.machines.crane_geometry import BASE, ELBOW, LIFT, TELESCOPE, TILT
from hdmm_opt.machines.rigid_body import GRAVITY
from hdmm_opt.plants.pmsm_emla import defaults, pmsm_emla, transmission

URDF = (Path(hdmm_opt.machines.__file__).parent / "crane.urdf").read_text(encoding="utf-8")
LOW, HIGH = (
    np.array([LIFT.usable(0.1)[0], TILT.usable(0.1)[0], 0.0]),
    np.array([LIFT.usable(0.1)[1], TILT.usable(0.1)[1], TELESCOPE]),
)


def compiled(expression):
    w, v, a, m = (ca.SX.sym(name, size) for name, size in (("w", 3), ("v", 3), ("a", 3), ("m", 1)))
    return ca.Function("f", [w, v, a, m], [expression(w, v, a, m)])


TORQUES = compiled(joint_torques)
FORCES = compiled(lambda w, v, a, m: drives(w, v, a, ca.SX.zeros(3), m).force)


def numbers(function, *arguments):
    return np.array(function(*arguments)).ravel()


def cases(count, seed=1):
    random = np.random.default_rng(seed)
    for _ in range(count):
        yield random.uniform(LOW, HIGH), random.uniform(-0.5, 0.5, 3), random.uniform(-1, 1, 3), random.uniform(0, 400)


def ends(loop):
    """Joint in the frame before it, actuator's fixed end there, and its moving end in the frame of the link."""
    joint = np.array(BASE if loop is LIFT else ELBOW)
    fixed = bodies_of_crane()[f"{loop.name}_cylinder"].position[[0, 2]]
    assert np.hypot(*(fixed - joint)) == pytest.approx(loop.a, abs=1e-12)
    moving = np.arctan2(*(fixed - joint)[::-1]) + loop.offset + np.pi
    return joint, fixed, loop.b * np.array([np.cos(moving), np.sin(moving)])


def closing(loop, w):
    """Angle and length of the actuator at a joint position, by plane geometry."""
    joint, fixed, moving = ends(loop)
    turn = np.array([[np.cos(w), -np.sin(w)], [np.sin(w), np.cos(w)]])
    along = joint + turn @ moving - fixed
    return np.arctan2(along[1], along[0]), np.hypot(*along)


def in_space(point):
    return np.array([point[0], 0.0, point[1]])


class Closed:
    """Pinocchio's model of the same file with the two loops as constraints."""

    def __init__(self, payload):
        self.model = pinocchio.buildModelFromXML(URDF)
        self.model.gravity.linear = np.array(GRAVITY)
        telescope = self.model.getJointId("telescope")
        self.model.appendBodyToJoint(
            telescope, pinocchio.Inertia(payload, np.zeros(3), np.zeros((3, 3))), pinocchio.SE3.Identity()
        )
        self.data = self.model.createData()
        constraints = []
        for loop in (LIFT, TILT):
            rod, link = (self.model.getJointId(name) for name in (f"{loop.name}_rod", loop.name))
            tip = pinocchio.SE3(np.eye(3), np.array([loop.dead, 0.0, 0.0]))
            place = pinocchio.SE3(np.eye(3), in_space(ends(loop)[2]))
            constraints.append(
                pinocchio.RigidConstraintModel(
                    pinocchio.ContactType.CONTACT_3D, self.model, rod, tip, link, place, pinocchio.ReferenceFrame.LOCAL
                )
            )
        self.constraints, self.stored = pinocchio.StdVec_RigidConstraintModel(), pinocchio.StdVec_RigidConstraintData()
        for constraint in constraints:
            self.constraints.append(constraint)
            self.stored.append(constraint.createData())

    def column(self, name):
        return self.model.joints[self.model.getJointId(name)].idx_v

    def state(self, w, v):
        q, rate = pinocchio.neutral(self.model), np.zeros(self.model.nv)
        step = 1e-6
        for k, name in enumerate(("lift", "tilt", "telescope")):
            q[self.model.joints[self.model.getJointId(name)].idx_q], rate[self.column(name)] = w[k], v[k]
        for k, loop in enumerate((LIFT, TILT)):
            angle, length = closing(loop, w[k])
            later, earlier = closing(loop, w[k] + step), closing(loop, w[k] - step)
            place = self.model.joints[self.model.getJointId(f"{loop.name}_cylinder")].idx_q
            q[place : place + 2] = np.cos(angle), np.sin(angle)
            q[self.model.joints[self.model.getJointId(f"{loop.name}_rod")].idx_q] = length - loop.dead
            turned = np.unwrap([earlier[0], later[0]])
            rate[self.column(f"{loop.name}_cylinder")] = (turned[1] - turned[0]) / (2 * step) * v[k]
            rate[self.column(f"{loop.name}_rod")] = (later[1] - earlier[1]) / (2 * step) * v[k]
        return q, rate

    def accelerations(self, w, v, forces):
        """Of the three joints, from the forces on the rods and on the telescope."""
        q, rate = self.state(w, v)
        effort = np.zeros(self.model.nv)
        for name, force in zip(("lift_rod", "tilt_rod", "telescope"), forces, strict=True):
            effort[self.column(name)] += force
        for k, name in enumerate(("lift", "tilt", "telescope")):
            effort[self.column(name)] -= DAMPING * v[k]
        pinocchio.initConstraintDynamics(self.model, self.data, self.constraints, self.stored)
        settings = pinocchio.ProximalSettings(1e-14, 1e-10, 100)
        found = pinocchio.constraintDynamics(
            self.model, self.data, q, rate, effort, self.constraints, self.stored, settings
        )
        return found[[self.column(name) for name in ("lift", "tilt", "telescope")]]


def test_forces_on_the_rods_give_the_accelerations_of_pinocchios_closed_chain():
    for w, v, a, payload in cases(25):
        forces = numbers(FORCES, w, v, a, payload)
        assert Closed(payload).accelerations(w, v, forces) == pytest.approx(a, abs=1e-9)


def mujoco_model(payload):
    """The same chain written in MuJoCo's own format, its loops closed by constraints."""

    def inertial(mass, centre, about):
        return f'<inertial pos="{centre[0]} 0 {centre[1]}" mass="{mass}" diaginertia="{about / 2} {about} {about}"/>'

    def actuator(loop):
        rod = f'<body name="{loop.name}_rod"><joint name="{loop.name}_rod" type="slide" axis="1 0 0"/>{inertial(10.35, (0.83 - 0.187, 0), 0.5579)}</body>'
        place = ends(loop)[1]
        return f'<body pos="{place[0]} 0 {place[1]}"><joint name="{loop.name}_cylinder" axis="0 -1 0"/>{inertial(17.36, (0.358, 0), 0.9076)}{rod}</body>'

    def loose(mass, centre, about):
        return f'<body pos="0 0 0">{inertial(mass, centre, about)}</body>'

    # the public frames, written out: directions of the pins below the links' axes, and what sits where
    pin, base, below = (np.arctan2(y, x) for x, y in ((373.313, 45.757), (1132.19, 139.50), (296.198, 88.061)))

    def turned(angle, x, y):
        return np.array([x * np.cos(angle) - y * np.sin(angle), x * np.sin(angle) + y * np.cos(angle)])

    tilt_base = np.array(ELBOW) - 1.13218582 * turned(base, 1, 0)
    extension = 0.30901133 * turned(-below, 1, 0) + turned(-below, -0.048858, 0.365874)
    tip = np.array([1.99949, 0.154167])
    end, rod = extension + [0.041 + 1.2 + 0.25467, -0.13034] - tip, extension + [0.041 + 0.56803, 0] - tip
    telescope = f'<body pos="{tip[0]} 0 {tip[1]}"><joint name="telescope" type="slide" axis="1 0 0"/>{inertial(570.19, end, 67.38)}{loose(6.73, rod, 0.918)}{loose(payload, (0, 0), 1e-9)}</body>'
    tilt = f'<body name="tilt_link" pos="{ELBOW[0]} 0 {ELBOW[1]}"><joint name="tilt" axis="0 -1 0"/>{inertial(33.93, turned(-below, 0.60505, 0.27199), 7.409)}{loose(9.26, extension + [0.62193, 0], 1.484)}{telescope}</body>'
    lift = f'<body name="lift_link" pos="{BASE[0]} 0 {BASE[1]}"><joint name="lift" axis="0 -1 0"/>{inertial(25.53, turned(-pin, 0.23806, 0.13202), 0.679)}{loose(54.59, tilt_base + turned(base, 0.54320, 0.10544), 5.973)}{tilt}{actuator(TILT)}</body>'
    closed = "".join(
        f'<connect body1="{loop.name}_rod" body2="{loop.name}_link" anchor="{loop.dead} 0 0"/>' for loop in (LIFT, TILT)
    )
    return mujoco.MjModel.from_xml_string(
        f'<mujoco><compiler inertiafromgeom="false" autolimits="false"/><option gravity="0 0 {GRAVITY[2]}"/><worldbody>{lift}{actuator(LIFT)}</worldbody><equality>{closed}</equality></mujoco>'
    )


def test_the_mass_matrix_is_that_of_mujocos_tree_on_the_closed_loops():
    """MuJoCo's `connect` is soft, so its exact tree is projected on the closed loops instead: Jᵀ M J."""
    payload = 120.0
    model = mujoco_model(payload)
    data = mujoco.MjData(model)
    order = {
        name: model.jnt_dofadr[mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_JOINT, name)]
        for name in ("lift", "tilt", "telescope", "lift_cylinder", "lift_rod", "tilt_cylinder", "tilt_rod")
    }
    for w, *_ in cases(10, seed=3):
        slope = np.zeros((model.nv, 3))
        q = np.zeros(model.nq)
        for k, name in enumerate(("lift", "tilt", "telescope")):
            q[order[name]], slope[order[name], k] = w[k], 1.0
        for k, loop in enumerate((LIFT, TILT)):
            step = 1e-6
            (angle, length), later, earlier = (
                closing(loop, w[k]),
                closing(loop, w[k] + step),
                closing(loop, w[k] - step),
            )
            q[order[f"{loop.name}_cylinder"]], q[order[f"{loop.name}_rod"]] = angle, length - loop.dead
            turned = np.unwrap([earlier[0], later[0]])
            slope[order[f"{loop.name}_cylinder"], k] = (turned[1] - turned[0]) / (2 * step)
            slope[order[f"{loop.name}_rod"], k] = (later[1] - earlier[1]) / (2 * step)
        data.qpos[:], data.qvel[:] = q, 0.0
        mujoco.mj_forward(model, data)
        full = np.zeros((model.nv, model.nv))
        mujoco.mj_fullM(model, data, full)
        still = numbers(TORQUES, w, np.zeros(3), np.zeros(3), payload)
        ours = np.stack([numbers(TORQUES, w, np.zeros(3), unit, payload) - still for unit in np.eye(3)])
        assert ours == pytest.approx(slope.T @ full @ slope, rel=1e-6, abs=1e-4)
        assert still == pytest.approx(slope.T @ data.qfrc_bias, rel=1e-6, abs=1e-4)
        assert np.linalg.eigvalsh(ours)[0] > 0


def test_power_into_the_rods_is_the_rate_of_the_energy_and_what_the_joints_dissipate():
    w, v, a, m = (ca.SX.sym(name, size) for name, size in (("w", 3), ("v", 3), ("a", 3), ("m", 1)))
    zero = ca.SX.zeros(3)
    moving = joint_torques(w, zero, a, m) - joint_torques(w, zero, zero, m)
    mass = ca.jacobian(moving, a)
    weight = joint_torques(w, zero, zero, m)
    kinetic = ca.dot(v, mass @ v) / 2
    rate = ca.jtimes(kinetic, w, v) + ca.dot(ca.gradient(kinetic, v), a) + ca.dot(weight, v)
    power = ca.dot(drives(w, v, a, zero, m).force, levers(w) * v) - DAMPING * ca.sumsqr(v)
    balance = ca.Function("b", [w, v, a, m], [rate, power])
    for case in cases(20, seed=5):
        energy, work = (float(x) for x in balance(*case))
        assert energy == pytest.approx(work, rel=1e-9, abs=1e-7)


def test_weights_are_the_slope_of_the_potential_energy():
    """Gravity's torques have no curl: they come from a potential, the actuators' bodies included."""
    w = ca.SX.sym("w", 3)
    zero = ca.SX.zeros(3)
    curl = ca.jacobian(joint_torques(w, zero, zero), w)
    matrix = ca.Function("c", [w], [curl])
    for case, *_ in cases(10, seed=6):
        found = np.array(matrix(case))
        assert found == pytest.approx(found.T, abs=1e-8)


def test_levers_are_the_slopes_of_the_strokes():
    w = ca.SX.sym("w", 3)
    slopes = ca.Function("s", [w], [ca.jacobian(strokes(w), w), levers(w)])
    for case, *_ in cases(10, seed=7):
        jacobian, lever = (np.array(x) for x in slopes(case))
        assert jacobian == pytest.approx(np.diag(lever.ravel()), abs=1e-12)


def test_the_drives_agree_with_the_actuators_own_model():
    """Torque and voltage hold the EMLA plant still at the same acceleration: h_2 = M_2 x'', h_3 = L i', h_4 = 0."""
    plant = pmsm_emla(
        "voltage",
        {**defaults("voltage"), "load_mass": defaults("voltage")["load_mass"].__class__(value=1e-9, unit="kg")},
    )
    rows = ca.Function("rows", [plant.x, plant.u, plant.w, plant.p], [plant.mass, plant.force])
    w, v, a, j = (ca.SX.sym(name, 3) for name in "wvaj")
    found = drives(w, v, a, j)
    ask = ca.Function("ask", [w, v, a, j], [found.force, found.speed, found.current, found.voltage, found.torque])
    values = [p.value for p in plant.parameters.values()]
    known = {name: p.value for name, p in plant.parameters.items()}
    for case, rate, gain, _ in cases(10, seed=8):
        force, speed, current, voltage, torque = (np.array(x).ravel() for x in ask(case, rate, gain, np.zeros(3)))
        second = np.array(
            ca.Function("g", [w, v, a], [levers(w) * a + ca.jtimes(levers(w), w, v) * v])(case, rate, gain)
        ).ravel()
        for i in range(3):
            rod = speed[i] * transmission(known)
            mass, push = (np.array(x).ravel() for x in rows([0.3, rod, current[i], 0.0], [0, 0], [force[i]], values))
            assert push[1] == pytest.approx(mass[1] * second[i], rel=1e-6, abs=1e-6)
            assert torque[i] == pytest.approx(known["torque_constant"] * current[i])
        assert (voltage >= 0).all()


def test_the_voltage_moves_the_current_along_the_motion():
    """The current's slope by time along a spline is what the voltage was computed with."""
    w, v, a, j = (ca.SX.sym(name, 3) for name in "wvaj")
    found = drives(w, v, a, j)
    ask = ca.Function("ask", [w, v, a, j], [found.current, found.voltage, found.speed])
    known = {name: p.value for name, p in defaults("voltage").items()}
    amplitude, centre = np.array([0.1, 0.15, 0.1]), (LOW + HIGH) / 2

    def at(t):
        phase = np.array([0.7, 1.1, 0.9]) * t
        rates = np.array([0.7, 1.1, 0.9])
        motion = (
            centre + amplitude * np.sin(phase),
            amplitude * rates * np.cos(phase),
            -amplitude * rates**2 * np.sin(phase),
            -amplitude * rates**3 * np.cos(phase),
        )
        return [np.array(x).ravel() for x in ask(*motion)]

    for t in (0.3, 1.7, 2.9):
        current, voltage, speed = at(t)
        slope = (at(t + 1e-5)[0] - at(t - 1e-5)[0]) / 2e-5
        electrical = known["pole_pairs"] * speed
        across = known["resistance"] * current + known["inductance"] * slope + known["torque_constant"] / 6 * electrical
        along = known["inductance"] * electrical * current
        assert voltage == pytest.approx(np.hypot(across, along), rel=1e-6)


def test_the_loads_of_the_class():
    """A public check of the masses: the end mass needs 51 to 58 kN of the lift where the crane works."""
    assert chain()[2].mass == pytest.approx(576.92)
    force = numbers(FORCES, [0.3, -0.6, 0.3], np.zeros(3), np.zeros(3), 0.0)
    assert 40e3 < force[0] < 70e3 and 25e3 < abs(force[1]) < 75e3


def test_rod_forces_are_the_joints_torques_over_their_levers():
    """Power is the same in both coordinates."""
    random = np.random.default_rng(3)
    w, v, a = (ca.SX.sym(name, 3) for name in "wva")
    lever = levers(w)
    gain = lever * a + ca.jtimes(lever, w, v) * v
    both = ca.Function(
        "both", [w, v, a], [rod_forces(strokes(w), lever * v, gain, 7.0), joint_torques(w, v, a, 7.0), lever]
    )
    for _ in range(20):
        at = np.array([0.4, -1.5, 0.5]) + random.uniform(-0.3, 0.3, 3)
        force, torque, arm = (
            np.array(part).ravel() for part in both(at, random.normal(size=3) * 0.2, random.normal(size=3))
        )
        np.testing.assert_allclose(force * arm, torque, rtol=1e-9, atol=1e-6)


def test_the_triangle_closes():
    for w, *_ in cases(5, seed=9):
        for k, loop in enumerate((LIFT, TILT)):
            assert closing(loop, w[k])[1] == pytest.approx(float(loop.extension(w[k])) + loop.dead, abs=1e-12)


@pytest.mark.parametrize(("payload", "stroke_lift", "stroke_tilt"), [(0.0, 0.2, 0.2), (300.0, 0.35, 0.4)])
def test_static_rod_forces_are_those_of_pinocchio(payload, stroke_lift, stroke_tilt):
    """At rest: the forces that hold Pinocchio's closed chain still, to a part in a million of 75 kN."""
    w = np.array([float(LIFT.coordinate(stroke_lift)), float(TILT.coordinate(stroke_tilt)), 0.4])
    closed, still = Closed(payload), np.zeros(3)
    ours = numbers(FORCES, w, still, still, payload)
    held = closed.accelerations(w, still, ours)
    slope = np.stack([closed.accelerations(w, still, ours + e) - held for e in 1e3 * np.eye(3)], axis=1) / 1e3
    exact = ours - np.linalg.solve(slope, held)
    assert ours == pytest.approx(exact, abs=0.075) and np.abs(ours[:2]).max() > 5e3


def test_frames_are_the_public_ones():
    """Pins at the printed distances, and the triangles at the printed angles."""
    _, _, moving = ends(LIFT)
    assert np.hypot(*moving) == pytest.approx(0.37610632) and LIFT.offset == pytest.approx(-2.073505, abs=1e-6)
    assert np.arctan2(*moving[::-1]) == pytest.approx(-np.arctan2(45.757, 373.313))
    _, fixed, moving = ends(TILT)
    assert np.hypot(*moving) == pytest.approx(0.30901133) and TILT.offset == pytest.approx(-0.411577, abs=1e-6)
    assert fixed == pytest.approx(
        np.array(ELBOW) - 1.13218582 * np.array([np.cos(a := np.arctan2(139.50, 1132.19)), np.sin(a)])
    )
