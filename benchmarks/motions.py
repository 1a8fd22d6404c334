"""Minimum-time motions beside other programs, in one run: `python benchmarks/motions.py`.

Every program gets the same task, limits, number of spans and first guess (a straight quintic move), default settings of
its own, and IPOPT where it uses it. Drake solves with its own choice of solver. Rockit has no splines of degree 5: it
gets multiple shooting with piecewise constant jerk on as many intervals.

Needs casadi, and for the rivals drake and rockit-meco; what is not installed is left out.
"""

from __future__ import annotations

import importlib.util
import sys
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import casadi as ca
import numpy as np
from scipy.interpolate import BSpline

from hdmm_opt.motions.enclosure import enclosure
from hdmm_opt.machines.rigid_body import inverse_dynamics
from hdmm_opt.machines.urdf import bodies
from hdmm_opt.motions.crane_task import crane_task
from trajectories import MotionLimits, Quantities, Task, Waypoint, solve
from trajectories.guess import Guess, remaining, straight
from trajectories import nodes, program
from trajectories.nodes import collocation_points
from trajectories.program import derivative_matrices
from trajectories.solver import solver_of
from trajectories.spline import Spline, clamped_knots

sys.path.insert(0, str(Path(__file__).parents[1] / "tests"))
from arms import serial_arm

GRID = 10_000
SPANS = 24


@dataclass(frozen=True, kw_only=True)
class Case:
    name: str
    urdf: str
    task: Task
    torque: ca.Function
    limit: np.ndarray


def case(joints: int, torque_limit: np.ndarray, start: np.ndarray, goal: np.ndarray) -> Case:
    urdf = serial_arm(joints)
    q, v, a, j = (ca.SX.sym(name, joints) for name in "qvaj")
    torque = inverse_dynamics(bodies(urdf), q, v, a)
    function = ca.Function("torque", [q, v, a, j], [torque])
    names = tuple(f"j{k + 1}" for k in range(joints))
    task = Task(
        waypoints=(Waypoint(value=start), Waypoint(value=goal)),
        limits=MotionLimits(
            position=(-2.8, 2.8), speed=np.full(joints, 2.0), acceleration=np.full(joints, 8.0),
            jerk=np.full(joints, 80.0), names=names, units=("rad",) * joints,
        ),
        quantities=Quantities(
            function=function, names=tuple(f"{n} torque" for n in names), units=("N m",) * joints,
            lower=-torque_limit, upper=torque_limit, enclose=enclosure(function),
        ),
        spans=SPANS,
    )  # fmt: skip
    return Case(name=f"{joints} joints, minimum time", urdf=urdf, task=task, torque=function, limit=torque_limit)


def violation(given: Case, curve: Callable[[np.ndarray, int], np.ndarray], duration: float) -> float:
    """Largest excess over a limit, relative to it, on a grid."""
    t = np.linspace(0.0, duration, GRID)
    curves = [curve(t, order) for order in range(4)]
    limits = given.task.limits
    shares = [(np.abs(curves[order]) / limits.of(order)).max() - 1 for order in (1, 2, 3)]
    torque = np.array(given.torque.map(GRID)(*(c.T for c in curves)))
    shares.append((np.abs(torque) / given.limit[:, None]).max() - 1)
    ends = [
        np.abs(curves[0][0] - given.task.waypoints[0].value).max(),
        np.abs(curves[0][-1] - given.task.waypoints[1].value).max(),
    ]
    return max(0.0, *shares, *(e - 1e-6 for e in ends))


def forget() -> None:
    """Leave nothing of earlier programs."""
    for kept in (program._built, solver_of, nodes._node):
        kept.cache_clear()


def ours(given: Case) -> tuple[float, Callable, float]:
    forget()
    return ours_again(given)


def ours_again(given: Case) -> tuple[float, Callable, float]:
    """With the program that the solve before it left."""
    motion = solve(given.task)
    return motion.cost, motion.spline, motion.spline.end


def opti(given: Case) -> tuple[float, Callable, float]:
    """The same program written with CasADi's Opti as its manual does."""
    task, limits = given.task, given.task.limits
    count, degree = len(limits.names), task.degree
    guess = straight(task)
    problem = ca.Opti()
    controls = SPANS + degree
    points, duration = problem.variable(controls, count), problem.variable()
    problem.minimize(duration)
    maps = derivative_matrices(SPANS, degree)
    for order in (1, 2, 3):
        derivative = ca.DM(maps[order]) @ points
        for k, limit in enumerate(limits.of(order)):
            problem.subject_to(problem.bounded(-limit * duration**order, derivative[:, k], limit * duration**order))
    for k in range(count):
        problem.subject_to(problem.bounded(-2.8, points[:, k], 2.8))
    for i in range(3):
        problem.subject_to(points[i, :] == ca.DM(task.waypoints[0].value).T)
        problem.subject_to(points[controls - 1 - i, :] == ca.DM(task.waypoints[1].value).T)
    knots = clamped_knots(0.0, 1.0, SPANS)
    unit = Spline(knots=knots, coefficients=np.eye(controls))
    for s in collocation_points(SPANS)[0]:
        x = [ca.DM(unit(np.array([s]), order)) @ points / duration**order for order in range(4)]
        torque = given.torque(*(value.T for value in x))
        problem.subject_to(problem.bounded(-ca.DM(given.limit), torque, ca.DM(given.limit)))
    problem.subject_to(duration >= 0.01)
    problem.set_initial(points, guess.points[0])
    problem.set_initial(duration, guess.durations[0])
    problem.solver("ipopt", {"print_time": False}, {"print_level": 0, "sb": "yes"})
    answer = problem.solve()
    t = float(answer.value(duration))
    spline = Spline(knots=t * knots, coefficients=np.array(answer.value(points)).reshape(controls, count))
    return t, spline, t


def rockit(given: Case) -> tuple[float, Callable, float]:
    """Multiple shooting, jerk constant on each interval, limits at the grid points."""
    import rockit as r

    limits, count = given.task.limits, len(given.task.limits.names)
    guess = straight(given.task)
    ocp = r.Ocp(T=r.FreeTime(float(guess.durations[0])))
    q, v, a, j = ocp.state(count), ocp.state(count), ocp.state(count), ocp.control(count)
    for state, rate in ((q, v), (v, a), (a, j)):
        ocp.set_der(state, rate)
    ocp.add_objective(ocp.T)
    for value, limit in ((v, limits.of(1)), (a, limits.of(2)), (j, limits.of(3)), (q, np.full(count, 2.8))):
        ocp.subject_to(-ca.DM(limit) <= (value <= ca.DM(limit)))
    torque = given.torque(q, v, a, j)
    ocp.subject_to(-ca.DM(given.limit) <= (torque <= ca.DM(given.limit)))
    for moment, place in ((ocp.at_t0, 0), (ocp.at_tf, 1)):
        ocp.subject_to(moment(q) == ca.DM(given.task.waypoints[place].value))
        ocp.subject_to(moment(v) == 0)
        ocp.subject_to(moment(a) == 0)
    start, goal = (ca.DM(w.value) for w in given.task.waypoints)
    ocp.set_initial(q, start + (goal - start) * ocp.t / float(guess.durations[0]))
    ocp.solver("ipopt", {"print_time": False, "ipopt": {"print_level": 0, "sb": "yes"}})
    ocp.method(r.MultipleShooting(N=SPANS + 5, M=1, intg="rk"))
    answer = ocp.solve()
    times, jerks = answer.sample(j, grid="control")
    _, states = answer.sample(ca.vertcat(q, v, a), grid="control")
    states, jerks = states.reshape(len(times), 3, count), jerks.reshape(len(times), count)

    def curve(t: np.ndarray, order: int) -> np.ndarray:
        k = np.clip(np.searchsorted(times, t, side="right") - 1, 0, len(times) - 2)
        s = (t - times[k])[:, None]
        p, u, w, z = states[k, 0], states[k, 1], states[k, 2], jerks[k]
        return (p + u * s + w * s**2 / 2 + z * s**3 / 6, u + w * s + z * s**2 / 2, w + z * s, z)[order]

    return float(times[-1]), curve, float(times[-1])


def drake(given: Case) -> tuple[float, Callable, float]:
    """Drake's KinematicTrajectoryOptimization on a B-spline of the same degree, effort bounds at the same points."""
    from pydrake.multibody.parsing import Parser
    from pydrake.multibody.plant import MultibodyPlant
    from pydrake.planning import KinematicTrajectoryOptimization
    from pydrake.solvers import IpoptSolver
    from pydrake.trajectories import BsplineTrajectory
    from pydrake.math import BsplineBasis, KnotVectorType

    task, limits, count = given.task, given.task.limits, len(given.task.limits.names)
    guess = straight(task)
    basis = BsplineBasis(task.degree + 1, clamped_knots(0.0, 1.0, SPANS).tolist())
    start = BsplineTrajectory(basis, [p[:, None] for p in guess.points[0]])
    planner = KinematicTrajectoryOptimization(start)
    assert KnotVectorType is not None
    planner.AddDurationCost(1.0)
    planner.AddDurationConstraint(0.01, 60.0)
    planner.AddPositionBounds(np.full(count, -2.8), np.full(count, 2.8))
    planner.AddVelocityBounds(-limits.of(1), limits.of(1))
    planner.AddAccelerationBounds(-limits.of(2), limits.of(2))
    planner.AddJerkBounds(-limits.of(3), limits.of(3))
    for s, place in ((0.0, 0), (1.0, 1)):
        value = np.asarray(task.waypoints[place].value)
        planner.AddPathPositionConstraint(value, value, s)
        planner.AddPathVelocityConstraint(np.zeros(count), np.zeros(count), s)
        planner.AddPathAccelerationConstraint(np.zeros(count), np.zeros(count), s)
    plant = MultibodyPlant(0.0)
    models = Parser(plant).AddModelsFromString(given.urdf, "urdf")
    plant.WeldFrames(plant.world_frame(), plant.GetFrameByName("l0", models[0]))
    from pydrake.multibody.tree import JointActuatorIndex  # noqa: F401

    for k in range(count):
        if not plant.HasJointActuatorNamed(f"j{k + 1}"):
            plant.AddJointActuator(f"j{k + 1}", plant.GetJointByName(f"j{k + 1}"), float(given.limit[k]))
    plant.mutable_gravity_field().set_gravity_vector([0.0, 0.0, -9.80665])
    plant.Finalize()
    planner.AddEffortBoundsAtNormalizedTimes(plant, collocation_points(SPANS)[0], -given.limit, given.limit)
    planner.SetInitialGuess(start)
    prog = planner.get_mutable_prog()
    prog.SetInitialGuess(planner.duration(), float(guess.durations[0]))
    answer = IpoptSolver().Solve(prog)
    if not answer.is_success():
        raise RuntimeError(f"Drake: {answer.get_solution_result()}")
    found = planner.ReconstructTrajectory(answer)
    t = found.end_time()
    coefficients = np.array([np.asarray(p).ravel() for p in found.control_points()])
    spline = BSpline(t * clamped_knots(0.0, 1.0, SPANS), coefficients, task.degree)
    return t, lambda times, order: spline.derivative(order)(times) if order else spline(times), t


def fastest(action: Callable, given: Case, repeats: int = 3) -> tuple[float, tuple]:
    result, times = action(given), []
    for _ in range(repeats):
        begun = time.perf_counter()
        result = action(given)
        times.append(time.perf_counter() - begun)
    return min(times), result


def replanned(spans: int) -> None:
    """A motion of the crane: the first solve of a process, another goal, and a start on the way."""
    start, goal = [0.2, -1.2, 0.2], [0.9, -0.8, 0.6]
    forget()
    solved = {}

    def timed(name: str, task: Task, guess: Guess | None = None) -> None:
        begun = time.perf_counter()
        motion = solve(task, guess=guess)
        solved[name] = (time.perf_counter() - begun, motion.iterations, motion)

    timed("first solve", crane_task([start, goal], payload=20.0, spans=spans))
    first = solved["first solve"][2].spline
    timed("the same again", crane_task([start, goal], payload=20.0, spans=spans))
    timed("another goal", crane_task([start, [0.88, -0.8, 0.6]], payload=20.0, spans=spans))
    here = Waypoint(value=first([1.0])[0], speed=first([1.0], 1)[0], acceleration=first([1.0], 2)[0])
    moving = crane_task([here, [0.88, -0.8, 0.6]], payload=20.0, spans=spans)
    timed("from the way, first", moving)
    timed("from the way, near", moving, remaining(moving, first, np.array([1.0, first.end])))
    print(f"\ncrane, {spans} spans\n{'program':22}{'seconds':>10}{'to first':>10}{'iterations':>12}{'time [s]':>10}")
    for name, (seconds, iterations, motion) in solved.items():
        share = seconds / solved["first solve"][0]
        print(f"{name:22}{seconds:10.3f}{share:10.2f}{iterations:12}{motion.spline.end:10.4f}")


def main() -> None:
    cases = [
        case(3, np.array([2.0, 18.0, 0.6]), np.array([0.0, 0.5, -0.8]), np.array([1.5, -0.6, 0.9])),
        case(7, np.array([6.0, 55.0, 10.0, 15.0, 1.0, 4.5, 0.1]), np.array([0.0, 0.6, 0.2, -0.9, 0.4, 0.7, 0.0]),
             np.array([1.4, -0.5, -0.6, 0.8, -0.7, -0.4, 1.0])),
    ]  # fmt: skip
    rivals = {"ours": ours, "ours again": ours_again, "Opti": opti, "rockit": rockit, "Drake": drake}
    missing = [
        name
        for name, module in (("rockit", "rockit"), ("Drake", "pydrake"))
        if importlib.util.find_spec(module) is None
    ]
    for spans in (24, 36):
        replanned(spans)
    for given in cases:
        print(
            f"\n{given.name}\n{'program':10}{'seconds':>10}{'to ours':>10}{'cost [s]':>12}{'to best':>10}{'violation':>12}"
        )
        rows = {}
        for name, action in rivals.items():
            if name in missing:
                print(f"{name:10} not installed")
                continue
            try:
                seconds, (cost, curve, duration) = fastest(action, given)
                rows[name] = (seconds, cost, violation(given, curve, duration))
            except RuntimeError as error:
                print(f"{name:10} failed: {str(error).splitlines()[0]}")
        best = min(row[1] for row in rows.values())
        for name, (seconds, cost, over) in rows.items():
            print(
                f"{name:10}{seconds:10.3f}{seconds / rows['ours'][0]:10.1f}{cost:12.5f}{100 * (cost / best - 1):9.2f}%{100 * over:11.3f}%"
            )


if __name__ == "__main__":
    main()
