"""Closed-loop runs of a machine: all joints, bodies, observers and faults together, under one scenario each."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from stability import Gains

from .control import gain_columns
from .machine_problem import MachineProblem
from .plants.rigid_joint import healthy
from .simulation import Batch, Engine, Fault, Yardstick
from .simulation.coupled import Coupled, compose_machine
from .simulation.loop import seed_of, steps_of
from .simulation.scenario import fault_column

Array = NDArray[np.float64]
GainSet = Mapping[str, tuple[Gains, ...]]


@dataclass(frozen=True, kw_only=True)
class MachineScenario:
    """One run of a machine.

    Attributes:
        name: Name for reports.
        payload: Payload, kg.
        parameters: Position of parameters in their tolerance, -1 … 1, by "joint.parameter" or by "parameter" for all.
        noise: Share of the assumed measurement errors, uniformly distributed, 0 … 1.
        quantisation: Share of the encoder's assumed error that is its rounding, 0 … 1.
        initial: Position of every joint's first error in its assumed range, -1 … 1.
        faults: What goes wrong with the actuators, by joint.
        seed: Seed of the noise.
    """

    name: str
    payload: float
    parameters: Mapping[str, float] = field(default_factory=dict)
    noise: float = 0.0
    quantisation: float = 0.0
    initial: float = 0.0
    faults: Mapping[str, Fault] = field(default_factory=dict)
    seed: int = 0


@dataclass(frozen=True, kw_only=True)
class MachineFigures:
    """What a run did.

    Attributes:
        tool: Largest distance of the tool from its reference at any time, m.
        tool_late: The same after the transient, m; infinite for a lost run.
        tool_rms: RMS of that distance after the transient, m.
        settling: First time after which the tool stays inside the required band, s.
        itae: Integral of time times that distance, m s².
        joints: Largest error of each joint after the transient, in its unit.
        joints_ever: Largest error of each joint at any time.
        joints_rms: RMS error of each joint after the transient.
        torques: Largest torque or force that each actuator delivered.
        torques_rms: RMS of the same over the run.
        uses: Largest share of a limit that each joint used.
        estimates: Largest error of each observer in position and in speed; empty where there is none.
        lost: Time at which the run was lost, s; infinite for a sound one.
    """

    tool: float
    tool_late: float
    tool_rms: float
    settling: float
    itae: float
    joints: tuple[float, ...]
    joints_ever: tuple[float, ...]
    joints_rms: tuple[float, ...]
    torques: tuple[float, ...]
    torques_rms: tuple[float, ...]
    uses: tuple[float, ...]
    estimates: tuple[tuple[float, float], ...]
    lost: float


@dataclass(frozen=True, kw_only=True)
class MachineTrace:
    """A run at the control instants.

    Attributes:
        t: Times, s. Shape (k,).
        x: Position of each joint. Shape (n, k).
        r: Its reference. Shape (n, k).
        u: Inputs of all joints as commanded. Shape (m, k).
        tool: Place of the tool, m. Shape (d, k).
        wanted: Its reference, m. Shape (d, k).
        lost: Time at which the run was lost, s.
    """

    t: Array
    x: Array
    r: Array
    u: Array
    tool: Array
    wanted: Array
    lost: float


class MachineLoop:
    """The loop of a machine, compiled once and run with any gains and scenarios.

    Args:
        problem: The machine's problem.
        outer: A law that commands the joints in place of RAC's outer stages, or None.
    """

    def __init__(self, problem: MachineProblem, outer: Any = None) -> None:
        study, self.problem, self.outer = problem.study, problem, outer
        section, noise = study.controller.observer, study.uncertainty.noise
        self.noise = (noise.position, 0.0 if section else noise.speed, noise.current_a)
        substeps = max(steps_of(plant, problem.period, 0.0) for plant in problem.machine.plants)
        self.loop = Coupled(
            machine=problem.machine, laws=tuple(axis.law for axis in problem.axes), outer=outer,
            observer=problem.observer, adapting=(section.epsilon, section.sigma) if section else (0.0, 1.0),
            noise=self.noise, foreseeing=problem.foreseeing, period=problem.period, substeps=substeps,
            yardstick=Yardstick(
                transient=study.validation.transient_s, band=study.requirements.tool_error_m, transmission=1.0
            ),
        )  # fmt: skip
        self._engine: Engine | None = None
        self._shared: Array | None = None

    @property
    def engine(self) -> Engine:
        """The engine, made at its first use."""
        if self._engine is None:
            self._engine = Engine(compose_machine(self.loop, self.problem.machine.joints))
        return self._engine

    def shared(self) -> Array:
        """References of all joints and the foreseen loads at the control instants. Shape (ticks, 5 n)."""
        if self._shared is None:
            problem, n = self.problem, len(self.problem.machine.joints)
            count = max(2, round(problem.axes[0].reference.duration / problem.period))
            t = problem.period * np.arange(count)
            r = np.stack([axis.reference(t) for axis in problem.axes])
            forces = problem.machine.forces.map(count)
            loads = np.array(forces(r[:, 0], r[:, 1], r[:, 2], np.full((1, count), problem.loads.middle)))
            loads = loads - np.array(problem.machine.own)[:, None] * r[:, 2]
            self._shared = np.ascontiguousarray(np.vstack([r.reshape(4 * n, count), loads]).T)
        return self._shared

    def figures(
        self, runs: Sequence[tuple[GainSet, MachineScenario]], *, jobs: int = 1, tuned: Sequence[Array] | None = None
    ) -> list[MachineFigures]:
        """Simulate runs together and keep their figures.

        Args:
            runs: Gains and scenarios.
            jobs: Threads.
            tuned: Parameters of the outer law in each run, where there is one.
        """
        if not runs:
            return []
        found = self.engine.run(self._batch(runs, tuned), jobs=jobs)
        names = [record.name for record in self.engine.system.records]
        return [
            self._figures(dict(zip(names, column, strict=True)), lost)
            for column, lost in zip(found.figures.T.tolist(), found.lost.tolist(), strict=True)
        ]

    def trace(self, gains: GainSet, scenario: MachineScenario, tuned: Array | None = None) -> MachineTrace:
        """Simulate one run and keep its signals."""
        batch = self._batch([(gains, scenario)], None if tuned is None else [tuned])
        found = self.engine.run(batch, trace=True)
        rows, n = self.engine.system.signal_rows(), len(self.problem.machine.joints)
        lost = float(found.lost[0])
        count = batch.shared.shape[0]
        kept = min(count, max(2, round(lost / self.problem.period))) if math.isfinite(lost) else count
        signals = {name: found.trace[:kept, part, 0].T for name, part in rows.items()}
        firsts = np.cumsum([0, *(len(plant.states) for plant in self.problem.machine.plants)])[:-1]
        return MachineTrace(
            t=self.problem.period * np.arange(kept), x=signals["x"][firsts], r=batch.shared[:kept, : 4 * n : 4].T,
            u=signals["u"], tool=signals["tool"], wanted=signals["wanted"], lost=lost,
        )  # fmt: skip

    def _batch(self, runs: Sequence[tuple[GainSet, MachineScenario]], tuned: Sequence[Array] | None) -> Batch:
        machine, shared = self.problem.machine, self.shared()
        columns = []
        for number, (gains, scenario) in enumerate(runs):
            columns.append(np.concatenate([
                *(np.array(gain_columns(gains[name])).ravel(order="F") for name in machine.joints),
                *(self._values(k, scenario) for k in range(len(machine.joints))),
                [scenario.payload],
                np.array(self.noise) * scenario.noise * np.array([1 - scenario.quantisation, 1.0, 1.0]),
                [2 * self.noise[0] * scenario.quantisation],
                *(fault_column(scenario.faults.get(name), len(plant.inputs))
                  for name, plant in zip(machine.joints, machine.plants, strict=True)),
                *([] if self.outer is None else [np.asarray(tuned[number] if tuned else ())]),
            ]))  # fmt: skip
        _, governed, inputs, further = self.loop.sizes
        n = len(machine.joints)
        x = np.stack([self._start(shared[0], gains, scenario) for gains, scenario in runs], axis=1)
        z = np.zeros((governed + 2 * inputs + 3 * n + further, len(runs)))
        firsts = np.cumsum([0, *(len(plant.states) for plant in machine.plants)])
        for i in range(n):
            # an observer starts from its first measurement and the reference's speed
            z[governed + 2 * inputs + 3 * i] = x[firsts[i]]
            z[governed + 2 * inputs + 3 * i + 1] = shared[0, 4 * i + 1]
        return Batch(
            fixed=np.array(columns).T,
            seeds=np.array([seed_of(scenario.seed) for _, scenario in runs], dtype=np.uint64),
            x=x, z=z, shared=shared,
            own=lambda run, first, size: np.zeros((0, size)),
        )  # fmt: skip

    def _start(self, first: Array, gains: GainSet, scenario: MachineScenario) -> Array:
        """The start nearest to rest inside the assumed initial errors, with the currents that the law asks for."""
        import casadi as ca

        n, initial = len(self.problem.machine.joints), self.problem.study.uncertainty.initial
        parts = []
        for i, (name, law) in enumerate(zip(self.problem.machine.joints, self.loop.laws, strict=True)):
            plant = law.plant
            r = first[4 * i : 4 * i + 4]
            load = first[4 * n + i] if self.loop.foreseeing else 0.0
            x = np.zeros(len(plant.states))
            error = scenario.initial * initial.position
            target = r[1] - gains[name][0].beta / 2 * error
            x[0], x[1] = r[0] + error, target + np.clip(-target, -initial.speed, initial.speed)
            terms = law.terms(ca.DM(x), ca.DM(r), ca.DM(list(plant.values().values())), ca.DM([load]))
            for k, row in enumerate(law.governed):
                following = [j for j, wanted in enumerate(plant.targets) if wanted == row]
                if row == 1 and following:
                    x[following[0]] = float(terms[k]) - gains[name][1].beta / 2 * (x[1] - target)
            parts.append(x)
        return np.concatenate(parts)

    def _values(self, k: int, scenario: MachineScenario) -> Array:
        """Parameters of a joint: nominal where a scenario does not say otherwise, actuators healthy."""
        name, plant = self.problem.machine.joints[k], self.problem.machine.plants[k]
        given, values = scenario.parameters, []
        for key, p in plant.parameters.items():
            usual = healthy(p) if key == "effectiveness" else 0.0
            values.append(p.value * (1 + p.tolerance * given.get(f"{name}.{key}", given.get(key, usual))))
        return np.array(values)

    def _figures(self, found: dict[str, float], lost: float) -> MachineFigures:
        problem, joints = self.problem, self.problem.machine.joints
        period, count = problem.period, self.shared().shape[0]
        gone = math.isfinite(lost)
        ticks = min(count, max(1, round(lost / period))) if gone else count
        late = max(1, ticks - math.ceil(problem.study.validation.transient_s / period))

        def each(what: str) -> tuple[float, ...]:
            return tuple(found[f"{what} {name}"] for name in joints)

        def rms(sums: tuple[float, ...], size: int) -> tuple[float, ...]:
            return tuple(math.sqrt(value / size) for value in sums)

        def sound(values: tuple[float, ...]) -> tuple[float, ...]:
            return (math.inf,) * len(values) if gone else values

        left = found["tool"] > self.loop.yardstick.band and found["outside"] >= 0
        watched = problem.observer is not None
        return MachineFigures(
            tool=math.inf if gone else found["tool"],
            tool_late=math.inf if gone else found["tool late"],
            tool_rms=math.inf if gone else math.sqrt(found["tool squares"] / late),
            settling=math.inf if gone else found["outside"] + period if left else 0.0,
            itae=math.inf if gone else found["tool itae"] * period,
            joints=sound(each("late")),
            joints_ever=sound(each("error")),
            joints_rms=sound(rms(each("squares"), late)),
            torques=each("torque"),
            torques_rms=rms(each("torque squares"), ticks),
            uses=each("use"),
            estimates=tuple(zip(each("estimated position"), each("estimated speed"), strict=True)) if watched else (),
            lost=lost,
        )
