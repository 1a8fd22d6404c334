"""A study of a machine made concrete: joints, references, and what the joints' proofs assume of each other."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from importlib import resources
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from stability import Bounds, Failure, Gains, Interval, certify_sampled, tangents_many
from stability.coupling import Loads, Slices, Tube
from stability.network import Contract, Subsystem, compose
from stability.observer import SampledObserver, sampled_bounds
from trajectories import LimitViolatedError, Reference, Spline, constant, pieces, quintic
from trajectories.spline import clamped_knots, fitted

from .axis import Axis, parameter_range, reference_ranges
from .control import RAC
from .crane_task import crane_cost
from .errors import InvalidInputError
from .job import Job, Move, carried_out
from .machine import Drive, Machine, arm, crane
from .machine_study import MachineStudy
from .plants import Parameter, defaults
from .plants.crane_dynamics import JOINTS, strokes
from .problem import gain_ranges, operating_box
from .study import nearest

Array = NDArray[np.float64]

#: How often each piece of the reference is halved into slices of time.
HALVINGS = 1
#: Loads are assumed this much larger than they come out here: the checker encloses them in another arithmetic.
SPARE = 1.005
#: Significant digits of the inertia that an axis' own model carries.
DIGITS = 3


@dataclass(frozen=True, kw_only=True)
class MachineProblem:
    """Everything that the design of a machine works on.

    Attributes:
        study: The study.
        machine: The machine.
        axes: One for each joint; their `bounds` are those of joints that keep to their references.
        slices: Ranges of all references over slices of time.
        loads: What the joints do to each other.
        observer: The observer of every joint, or None where speeds are measured.
    """

    study: MachineStudy
    machine: Machine
    axes: tuple[Axis, ...]
    slices: Slices
    loads: Loads
    observer: SampledObserver | None

    @property
    def foreseeing(self) -> bool:
        """Whether the law knows the loads along the reference."""
        return "mechanics" in self.study.controller.modelling

    @property
    def period(self) -> float:
        """Control period, s."""
        return 1 / self.study.controller.rate_hz

    def subsystems(self, gains: Mapping[str, tuple[Gains, ...]]) -> dict[str, Subsystem]:
        """The loops with given gains, by joint."""
        return {
            name: Subsystem(model=axis.model, gains=gains[name], limit=axis.box)
            for name, axis in zip(self.machine.joints, self.axes, strict=True)
        }

    def assume(self, promises: Mapping[str, Tube]) -> dict[str, Bounds]:
        """What each joint's proof assumes when all joints keep their promises."""
        tubes = [promises[name] for name in self.machine.joints]
        sizes, _ = self.loads.surprise(self.slices, tubes)
        found = {}
        for name, axis, tube, size in zip(self.machine.joints, self.axes, tubes, sizes, strict=True):
            middle = Interval(0.0) if self.foreseeing else axis.bounds.disturbances["load_force"]
            found[name] = replace(
                axis.bounds, disturbances={"load_force": middle + Interval.symmetric(SPARE * size)},
                noise=self._noise(axis, tube),
            )  # fmt: skip
        return found

    def _noise(self, axis: Axis, tube: Tube) -> tuple[float, ...]:
        section = self.study.uncertainty.noise
        currents = (section.current_a,) * (len(axis.plant.states) - 2)
        if self.observer is None:
            return (section.position, section.speed, *currents)
        # |v(0) - r'(0)|, from the bounds on |Q_1(0)| and |Q_2(0)|
        start = axis.bounds.initial[1] + axis.ranges[0].high / 2 * axis.bounds.initial[0]
        proof = sampled_bounds(
            self.observer, noise=section.position, initial=start,
            acceleration=observed(tube, axis.bounds.reference[3].magnitude, self.period),
        )  # fmt: skip
        assert proof is not None  # it was there for a tube of nothing, and its contraction does not depend on the tube
        return (proof.position, proof.speed, *currents)

    def composed(self, gains: Mapping[str, tuple[Gains, ...]]) -> dict[str, Contract] | Failure:
        """Contracts of all joints, or why there are none."""
        return compose(self.subsystems(gains), self.assume)

    def alone(self, gains: Mapping[str, tuple[Gains, ...]]) -> Failure | None:
        """Why a joint cannot be proved even where its neighbours keep to their references."""
        assumed = self.assume(still(self.machine.joints))
        for name, axis in zip(self.machine.joints, self.axes, strict=True):
            found = certify_sampled(axis.model, assumed[name], gains[name], axis.box)
            if isinstance(found, Failure):
                return replace(found, reason=f"{name}: {found.reason}")
        return None


def still(joints: tuple[str, ...]) -> dict[str, Tube]:
    """Promises of joints that keep to their references."""
    return dict.fromkeys(joints, Tube(position=0.0, speed=0.0, acceleration=0.0))


def observed(tube: Tube, jerk: float, period: float) -> float:
    """Bound on |x'' - r''(t_k)| within a period: the observer is given the reference's acceleration as it is held."""
    return (tube.acceleration + period * jerk) * (1 + 1e-9)


def assemble_machine(study: MachineStudy, references: tuple[Reference, ...] | None = None) -> MachineProblem:
    """Build the machine, its references and its assumptions.

    Args:
        study: A validated study.
        references: References that were already made for it, one a joint in coordinates of the actuators.

    Raises:
        InvalidInputError: an unreachable reference, or sections that do not fit each other.
    """
    machine = built(study)
    _known_parameters(study, machine)
    if references is None:
        references = _references(study, machine)
    slices = sliced(references)
    machine = machine.carrying(_own(machine, slices, _payload(study)))
    loads = machine.loads(_payload(study))
    observer = _observer(study)
    foreseen = loads.foreseen(slices)
    axes = tuple(_axis(study, machine, k, references[k], foreseen[k]) for k in range(len(machine.joints)))
    return MachineProblem(study=study, machine=machine, axes=axes, slices=slices, loads=loads, observer=observer)


def _known_parameters(study: MachineStudy, machine: Machine) -> None:
    """Refuse scenarios that name parameters which no joint has."""
    known = {key for plant in machine.plants for key in plant.parameters}
    known |= {
        f"{name}.{key}" for name, plant in zip(machine.joints, machine.plants, strict=True) for key in plant.parameters
    }
    for scenario in study.validation.scenarios:
        for name in scenario.parameters:
            if name not in known:
                where = f"validation.scenarios.{scenario.name}.parameters.{name}"
                raise InvalidInputError(f"{where} is unknown; {nearest(name, sorted(known))}")


def built(study: MachineStudy) -> Machine:
    """The machine of a study.

    Raises:
        InvalidInputError: a URDF file that cannot be read, or joints that it does not have.
    """
    section = study.plant
    if section.model == "crane":
        return crane({name: _parameters(study, name) for name in JOINTS}, section.locked)
    drives = {}
    for name, drive in section.joints.items():
        assert drive.armature is not None and drive.torque is not None and drive.speed_limit is not None
        drives[name] = Drive(
            armature=(drive.armature.value, drive.armature.tolerance or 0.0, drive.armature.source),
            torque=(drive.torque.value, drive.torque.source), speed=drive.speed_limit,
            effectiveness=drive.least_effectiveness,
        )  # fmt: skip
    machine = arm(_urdf(str(section.urdf)), drives, section.damping, section.tip_m)
    for name, plant in zip(machine.joints, machine.plants, strict=True):
        drive = section.joints[name]
        assert drive.armature is not None and drive.torque is not None
        for key, given, wanted in (
            ("torque", drive.torque.unit, plant.input_unit),
            ("armature", drive.armature.unit, plant.parameters["armature"].unit),
        ):
            if given != wanted:
                raise InvalidInputError(
                    f'plant.joints.{name}.{key}.unit must be "{wanted}": got "{given}"; convert the value'
                )
    return machine


def _urdf(name: str) -> str:
    bundled = resources.files("hdmm_opt") / "plants" / f"{name}.urdf"
    if name.isidentifier() and bundled.is_file():
        return bundled.read_text(encoding="utf-8")
    try:
        return Path(name).read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError) as error:
        reason = error.strerror if isinstance(error, OSError) and error.strerror else "it is not UTF-8 text"
        raise InvalidInputError(f"plant.urdf: cannot read {name}: {reason}; check the path") from None


def _parameters(study: MachineStudy, joint: str) -> dict[str, Parameter]:
    """Replacements for an EMLA's parameters: those of all joints, then those of this one."""
    known, found = defaults("voltage"), {}
    own = study.plant.joints.get(joint)
    for section in (study.plant.parameters, own.parameters if own else {}):
        for name, given in section.items():
            tolerance = known[name].tolerance if given.tolerance is None else given.tolerance
            found[name] = Parameter(
                value=given.value, unit=given.unit, tolerance=tolerance, source=given.source,
                meaning=known[name].meaning,
            )  # fmt: skip
    return found


def _payload(study: MachineStudy) -> Interval:
    return Interval(*study.uncertainty.payload_kg)


def _observer(study: MachineStudy) -> SampledObserver | None:
    section = study.controller.observer
    if section is None:
        return None
    observer = SampledObserver.of_bandwidth(section.bandwidth_rad_s, section.largest, 1 / study.controller.rate_hz)
    if sampled_bounds(observer, noise=0.0, acceleration=1.0, initial=0.0) is None:
        raise InvalidInputError(
            f"controller.observer must contract for every adaptive scalar: got {section.bandwidth_rad_s:g} "
            f"rad/s with largest = {section.largest:g} at {study.controller.rate_hz:g} Hz; lower one of them"
        )
    return observer


def _own(machine: Machine, slices: Slices, payload: Interval) -> tuple[float, ...]:
    """The middle of each joint's inertia along the reference, in a few digits."""
    n = len(machine.joints)
    forces = machine.forces
    middle = (slices.low + slices.high)[0] / 2
    still_there = [0.0] * n

    def inertia(x: Array, j: int) -> float:
        pushed, held = (forces(x, still_there, a, payload.high) for a in (np.eye(n)[j], still_there))
        return float(pushed[j]) - float(held[j])

    found = np.array([[inertia(x, j) for j in range(n)] for x in middle.T])
    return tuple(float(f"{v:.{DIGITS}g}") for v in (found.min(axis=0) + found.max(axis=0)) / 2)


def _axis(
    study: MachineStudy, machine: Machine, k: int, reference: Reference, foreseen: tuple[Interval, Interval]
) -> Axis:
    plant, name = machine.plants[k], machine.joints[k]
    try:
        law = RAC(plant=plant, modelling=study.controller.modelling)
    except ValueError as error:
        raise InvalidInputError(f"controller: {error}") from None
    known = "mechanics" in study.controller.modelling
    initial = study.uncertainty.initial
    bounds = Bounds(
        parameters={key: parameter_range(p) for key, p in plant.parameters.items()},
        disturbances={"load_force": Interval(0.0) if known else foreseen[0]},
        nominal={**plant.values(), **({} if known else {"load_force": 0.0})},
        reference=reference_ranges(reference),
        noise=(0.0,) * len(plant.states),
        initial=(initial.position, initial.speed, *(initial.current_a,) * (len(plant.states) - 2)),
        period=1 / study.controller.rate_hz,
        transient=study.validation.transient_s,
        feedforward={"load_force": foreseen} if known else {},
    )
    given = {**study.controller.gains, **study.controller.joints.get(name, {})}
    where = f"controller.joints.{name}" if name in study.controller.joints else "controller.gains"
    return Axis(
        plant=plant, law=law, model=law.loop_model(), reference=reference, bounds=bounds, box=operating_box(plant),
        ranges=gain_ranges(law, given, where),
    )  # fmt: skip


def _references(study: MachineStudy, machine: Machine) -> tuple[Reference, ...]:
    """Moves through the waypoints in coordinates of the actuators, with a dwell before, between and after."""
    section = study.reference
    moves = _crane_moves(study) if study.plant.model == "crane" else _arm_moves(study)
    segments: list[list[Spline]] = [[] for _ in machine.joints]
    clock = 0.0
    for number, move in enumerate(moves):
        starts = [float(spline.coefficients[0]) for spline in move]
        if section.dwell_s > 0:
            for own, start in zip(segments, starts, strict=True):
                own.append(constant(start, clock, clock + section.dwell_s))
            clock += section.dwell_s
        for own, spline in zip(segments, move, strict=True):
            moved = Spline(knots=clock + (spline.knots - spline.start) / section.pace, coefficients=spline.coefficients)
            own.append(_joining(moved, clock))
        clock = segments[0][-1].end
        if number + 1 == len(moves) and section.dwell_s > 0:
            for own in segments:
                own.append(constant(float(own[-1].coefficients[-1]), clock, clock + section.dwell_s))
    if not study.validation.transient_s < segments[0][-1].end:
        raise InvalidInputError(
            f"validation.transient_s ends before the reference does: got {study.validation.transient_s:g} s of "
            f"{segments[0][-1].end:g} s; shorten the transient"
        )
    return tuple(Reference(segments=tuple(own)) for own in segments)


def _joining(spline: Spline, clock: float) -> Spline:
    """The spline with its first knots exactly at a time."""
    knots = spline.knots.copy()
    knots[: spline.degree + 1] = clock
    knots[-spline.degree - 1 :] = knots[-1]
    return Spline(knots=knots, coefficients=spline.coefficients)


def _arm_moves(study: MachineStudy) -> list[list[Spline]]:
    section = study.reference
    return [
        [quintic(a, b, 0.0, duration) for a, b in zip(start, goal, strict=True)]
        for start, goal, duration in zip(section.waypoints, section.waypoints[1:], section.durations_s, strict=False)
    ]


def _crane_moves(study: MachineStudy) -> list[list[Spline]]:
    """Optimal motions of the joints, as splines of the strokes.

    The stroke is a smooth function of the joint: a spline through it on twice the spans is the reference from here on.
    """
    import casadi as ca

    section = study.reference
    locked = study.plant.locked

    def whole(place: tuple[float, ...]) -> tuple[float, float, float]:
        given = dict(zip(study.joints, place, strict=True))
        first, second, third = (given[name] if name in given else _locked(name, locked[name]) for name in JOINTS)
        return (first, second, third)

    places = [whole(place) for place in section.waypoints]
    payload = study.uncertainty.payload_kg[1]
    job = Job(
        start=places[0], moves=tuple(Move(joints=place, payload=payload) for place in places[1:]),
        longest=section.longest_s,
    )  # fmt: skip
    try:
        found = carried_out(
            job, lambda mass: crane_cost(payload=mass, time=1.0, jerk=section.jerk_weight), "reference",
            spans=section.spans,
        )  # fmt: skip
    except LimitViolatedError as error:
        raise InvalidInputError(f"reference: {error}") from None
    w = ca.SX.sym("w", 3)
    stroke = ca.Function("stroke", [w], [strokes(w)])
    kept = [k for k, name in enumerate(JOINTS) if name not in locked]
    return [_strokes(motion.spline, stroke, kept, 2 * section.spans) for motion in found.motions]


def _locked(name: str, stroke: float) -> float:
    """The joint coordinate of a locked actuator's stroke."""
    from .plants.crane import LIFT, TILT

    loops = {"lift": LIFT, "tilt": TILT}
    return float(loops[name].coordinate(stroke)) if name in loops else stroke


def _strokes(spline: Spline, stroke: Any, kept: list[int], spans: int) -> list[Spline]:
    knots = clamped_knots(spline.start, spline.end, spans)
    t = np.linspace(spline.start, spline.end, 40 * spans + 1)
    values = np.array(stroke.map(t.size)(spline(t).T)).T[:, kept]
    found = fitted(t, values, knots)
    points = found.coefficients.copy()
    points[:3], points[-3:] = values[0], values[-1]  # at rest at both ends, exactly
    return [Spline(knots=knots, coefficients=np.ascontiguousarray(points[:, k])) for k in range(points.shape[1])]


def sliced(references: tuple[Reference, ...]) -> Slices:
    """Ranges of all references over slices of time: the pieces between knots, halved."""
    parts: Slices | None = None
    for segments in zip(*(reference.segments for reference in references), strict=True):
        together = Spline(knots=segments[0].knots, coefficients=np.stack([s.coefficients for s in segments], axis=1))
        found = pieces(together)
        still_here = len(found.start) == 1
        for _ in range(0 if still_here else HALVINGS):
            found = found.halved()
        low, high = found.ranges()
        part = Slices(low=low[:4], high=high[:4])
        parts = part if parts is None else parts.merged(part)
    assert parts is not None
    return parts


def tool_errors(problem: MachineProblem, radii: Array) -> float:
    """Bound on the distance of the tool from its reference while |x_i - r_i| <= radii_i, m."""
    reference = problem.slices.low[0], problem.slices.high[0]
    ranges = {f"x{j}": (reference[0][j] - radius, reference[1][j] + radius) for j, radius in enumerate(radii)}
    unit = np.ones(problem.slices.low.shape[2])
    along = tangents_many(problem.machine.tool_expression, ranges, {name: {name: (unit, unit)} for name in ranges})
    squared = np.zeros_like(unit)
    for coordinate in along:
        size = np.zeros_like(unit)
        for name, (low, high) in coordinate.items():
            size = size + np.maximum(np.abs(low), np.abs(high)) * radii[int(name[1:])]
        squared = squared + size**2
    return float(np.sqrt(squared.max()) * (1 + 1e-9))
