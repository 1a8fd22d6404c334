"""Runs as arrays for the engine: constants, starts, references, courses of the disturbances."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from stability.loops.model import BALANCE, CONSTANT, balance_of

from ..control.law import step_function
from ..machines.body import ground_at
from ..problem import GainSet, Problem
from .engine.engine import Batch
from .layout import Part, size_of
from .scenario import SOUND, Course, Scenario, course_at

Array = NDArray[np.float64]

#: Courses of jitter that runs differ by.
PHASES = 997


@dataclass(frozen=True, kw_only=True)
class Run:
    """One run: gains that meet a scenario."""

    gains: GainSet
    scenario: Scenario


class Batches:
    """Makes batches for one loop.

    Args:
        problem: The problem.
        parts: Its members in the loop.
        period: Duration of a tick, s.
    """

    def __init__(self, problem: Problem, parts: Sequence[Part], period: float) -> None:
        self.problem, self.parts, self.period = problem, parts, period
        self._shared: Array | None = None
        self._goals: dict[int, Any] = {}
        self._steps: dict[int, Any] = {}

    def shared(self) -> Array:
        """References of all members, then the foreseen loads, at the ticks. Shape (ticks, 4 n or 5 n)."""
        if self._shared is None:
            problem, machine = self.problem, self.problem.machine
            count = max(2, round(problem.duration / self.period))
            t = self.times(count)
            r = np.stack([member.reference(t) for member in problem.members])
            columns = [r.reshape(4 * len(r), count)]
            if problem.foreseeing:
                assert problem.loads is not None
                still = np.zeros(count)
                x, v, a = (
                    np.stack([
                        r[k][order if p.first == "position" else order - 1] if order or p.first == "position" else still
                        for k, p in enumerate(machine.plants)
                    ])
                    for order in range(3)
                )  # fmt: skip
                middle = np.repeat(np.array([list(problem.loads.middle.values())]).T, count, axis=1)
                loads = np.array(machine.forces.map(count)(x, v, a, middle))
                columns.append(loads - np.array(machine.own)[:, None] * a)
            self._shared = np.ascontiguousarray(np.vstack(columns).T)
        return self._shared

    def times(self, count: int) -> Array:
        """Times of the ticks, s."""
        return np.asarray(self.period * np.arange(count), dtype=np.float64)

    def batch(self, runs: Sequence[Run], duration: float | None = None) -> Batch:
        """The runs as arrays; `duration` cuts them short, s."""
        shared = self.shared()
        if duration is not None:
            shared = shared[: max(2, round(duration / self.period))]
        fixed = np.array([self._constants(run) for run in runs]).T
        names = [d.name for d in self.problem.machine.disturbances]
        t = self.times(shared.shape[0])
        courses = [[self._course(run.scenario, name) for name in names] for run in runs]
        body = self.problem.machine.body

        def own(run: int, first: int, size: int) -> Array:
            now, ground = t[first : first + size], runs[run].scenario.ground
            met = np.stack([course_at(course, now) for course in courses[run]])
            return met if ground is None or body is None else np.vstack([met, ground_at(body, ground, now)])

        x, z = self.starts(fixed, [run.scenario for run in runs])
        return Batch(
            fixed=fixed, seeds=np.array([seed_of(run.scenario.seed) for run in runs], dtype=np.uint64), x=x, z=z,
            shared=shared, own=own,
        )  # fmt: skip

    def _course(self, scenario: Scenario, name: str) -> Course:
        """The course of a disturbance: its own, that of all of its kind, or the middle of its range."""
        return scenario.course(name) or self._middle(name)

    def _middle(self, name: str) -> Any:
        span = self.problem.disturbance(name)
        return ((0.0, (span.low + span.high) / 2),)

    def _constants(self, run: Run) -> Array:
        """The constants of a run, in the order of `layout.py`."""
        s, columns = run.scenario, []
        random = s.noise * (1 - abs(s.bias)) * (1 - s.quantisation)
        for part in self.parts:
            plant, steps = part.law.plant, np.array(part.resolution)
            bounds = (np.array(part.noise) - steps / 2)[part.noisy]
            fault = s.faults.get(part.name, SOUND)
            columns += [
                np.asarray(run.gains[part.name]),
                [s.parameter(part.name, name, p) for name, p in plant.parameters.items()],
                bounds * random, bounds * s.bias * (1 - s.quantisation),
                np.where(steps > 0, steps, 2 * s.quantisation * np.array(part.noise)),
                fault.column(len(plant.inputs)), [float(s.seed % PHASES)] if part.early else [],
            ]  # fmt: skip
        return np.concatenate([np.asarray(column, dtype=float) for column in columns])

    def starts(self, fixed: Array, scenarios: Sequence[Scenario]) -> tuple[Array, Array]:
        """States and discrete states at the first tick, for constants of shape (f, lanes).

        Every member starts nearest to rest inside its assumed initial errors; the scenario places the first one.
        """
        first, lanes = self.shared()[0], fixed.shape[1]
        bodies = self._bodies(scenarios)
        x = np.vstack([np.zeros((size_of(self.parts, "x"), lanes)), bodies])
        z = np.zeros((size_of(self.parts, "z"), lanes))
        asked = self._asked(scenarios, bodies)
        shares = np.array([scenario.initial for scenario in scenarios])
        n = len(self.parts)
        for k, (part, member) in enumerate(zip(self.parts, self.problem.members, strict=True)):
            own, r = np.zeros((len(member.plant.states), lanes)), first[4 * k : 4 * k + 4]
            initial = member.bounds.initial
            own[0] = r[0] + initial[0] * shares
            load = [first[4 * n + k]] if self.problem.foreseeing else [
                member.bounds.nominal[name] for name in member.plant.disturbances
            ]  # fmt: skip
            constants = part.constants(fixed)
            gains = constants["gains"]
            reference = np.repeat(r[:, None], lanes, axis=1)
            acting = self._acting(k, scenarios, asked)
            for i in range(1, len(own)):
                target = self._targets(k, own, reference, gains, load, acting, constants["parameters"])[i]
                own[i] = target + np.clip(-target, -initial[i], initial[i])
            x[part.x] = own
            discrete = part.discrete(z)
            discrete["law"][:] = np.reshape(
                np.array([part.law.start(x0.tolist(), g.tolist()) for x0, g in zip(own.T, gains.T, strict=True)]).T,
                (part.law.states, lanes),
            )
            discrete["seen"][:] = own[0]
            if part.monitor is not None:  # its estimates have settled
                discrete["monitor"][: len(own)] = own
            seen = own.copy()
            if part.observer is not None:  # it starts from the first measurement and the reference's speed
                discrete["observer"][0], seen[1] = own[0] - r[0], r[1]
            if part.waiting:
                commands = self._first_commands(k, seen, reference, discrete["law"], gains, load)
                discrete["pending"][:] = np.tile(commands, (part.waiting + part.early, 1))
        return x, np.vstack([z, asked, asked])

    def _first_commands(self, k: int, x: Array, r: Array, z: Array, gains: Array, load: Sequence[float]) -> Array:
        """The first input of each run without measurement errors: it acts until the first one has passed its delay."""
        part, nominal = self.parts[k], list(self.parts[k].law.plant.values().values())
        if k not in self._steps:
            self._steps[k] = step_function(part.law, part.period)
        step, lanes = self._steps[k], x.shape[1]
        return np.array(step.map(lanes)(x, r, z, gains, *(np.tile(v, (lanes, 1)).T for v in (nominal, list(load))))[0])

    def _bodies(self, scenarios: Sequence[Scenario]) -> Array:
        """The states of the body in which each run begins. Shape (b, lanes), (0, lanes) without one."""
        body, now = self.problem.machine.body, np.zeros(1)
        if body is None or scenarios[0].ground is None:
            return np.zeros((0, len(scenarios)))
        speeds = [float(self.shared()[0][4 * k]) for k in range(len(self.parts))]
        return np.array([
            body.start(speeds, [float(v) for v in ground_at(body, s.ground or {}, now)[:, 0]]) for s in scenarios
        ]).T  # fmt: skip

    def _acting(self, k: int, scenarios: Sequence[Scenario], asked: Array) -> Array:
        """The disturbances that a member's targets read, at the first instant; the middles of those that jump.

        Shape (w, lanes).
        """
        member, machine = self.problem.members[k], self.problem.machine
        names = member.plant.disturbances
        read = {name.partition("/")[0] for row in member.model.rows for name in row.place}
        read |= set(names) if member.model.balanced else set()
        found = np.zeros((len(names), len(scenarios)))
        for j, name in enumerate(names):
            if name in read:
                full = machine.disturbances[machine.met_by(k)[j]].name if machine.free else name
                jumps = self.problem.rate_of(name) is None
                courses = (self._middle(name) if jumps else self._course(s, full) for s in scenarios)
                found[j] = [course_at(course, np.zeros(1))[0] for course in courses]
                if len(asked) and machine.body is not None and full in machine.body.met:
                    found[j] = asked[machine.body.met.index(full)]
        return found

    def _asked(self, scenarios: Sequence[Scenario], bodies: Array) -> Array:
        """What the body asks of the members at the first instant. Shape (d, lanes), (0, lanes) without one."""
        body = self.problem.machine.body
        if body is None or not len(bodies):
            return np.zeros((0, len(scenarios)))
        speeds = [float(self.shared()[0][4 * k]) for k in range(len(self.parts))]
        ground = [ground_at(body, s.ground or {}, np.zeros(1)) for s in scenarios]
        return np.hstack([np.array(body.loads(own, speeds, g)) for own, g in zip(bodies.T, ground, strict=True)])

    def _targets(
        self, k: int, x: Array, r: Array, gains: Array, load: Sequence[float], acting: Array, p: Array
    ) -> Array:
        """What each state of a member tracks; nothing but the reference where its law is a rival. Shape (n, lanes)."""
        member = self.problem.members[k]
        if self.parts[k].law is not member.law:
            gains = np.repeat(np.array([[item.low for item in member.ranges]]).T, x.shape[1], axis=1)
        if k not in self._goals:
            self._goals[k] = _targets_of(member.law)
        return np.array(self._goals[k](x, r, gains, load, acting, p))


def _targets_of(law: Any) -> Any:
    """CasADi function (x, r, gains, load, what acts, p) -> target of each row; θ̂ at zero, networks at the preload."""
    import casadi as ca

    plant = law.plant
    x, r = ca.SX.sym("x", len(plant.states)), ca.SX.sym("r", 4)
    gains, load = ca.SX.sym("gains", len(law.schema)), ca.SX.sym("load", plant.w.numel())
    nominal = ca.DM(list(plant.values().values()))
    start = ca.vertcat(*law.start([0.0] * len(plant.states), ca.vertsplit(gains)))
    virtual, _ = law.virtual_controls(x, r, start, gains, nominal, load)
    acting, p = ca.SX.sym("acting", plant.w.numel()), ca.SX.sym("p", plant.p.numel())
    signals = {CONSTANT: ca.SX(1), **{f"r{k}": r[k] for k in range(3)}} | {
        name: acting[k] for k, name in enumerate(plant.disturbances)
    }
    signals |= {f"{load}/{name}": acting[k] / p[j] for k, load in enumerate(plant.disturbances)
                for j, name in enumerate(plant.parameters)}  # fmt: skip
    signals |= {
        balance_of(plant.states[i]): plant.balanced(i, r, acting, p)
        for i, target in enumerate(plant.targets) if target == BALANCE
    }  # fmt: skip
    goals = [
        virtual[row.target] if isinstance(row.target, int)
        else sum((share * signals[name] for name, share in row.place.items()), ca.SX(0)) for row in law.rows
    ]  # fmt: skip
    return ca.Function("targets", [x, r, gains, load, acting, p], [ca.vertcat(*goals)])


def seed_of(seed: int) -> int:
    """A seed of the draws: neighbouring numbers give unrelated streams."""
    return int(np.random.SeedSequence(seed).generate_state(1, np.uint64)[0])
