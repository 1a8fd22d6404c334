"""The closed loop of a problem, composed once, compiled once, and run with any gains and scenarios.

The plants are integrated by classical Runge-Kutta steps that are finer than the control period; inputs and disturbances
are held over a tick. Simulation agrees or disagrees with a proof; it never proves.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..control import Law
from ..problem import GainSet, Problem
from .batch import Batches, Run
from .compose import compose
from .engine.engine import Batch, Engine
from .engine.system import System
from .figures import Figures, figures
from .layout import parts_of
from .records import Settings
from .scenario import Scenario
from .sensitivity import differentiated
from .steps import steps_of, tick_of
from .trace import MemberTrace, Trace

Array = NDArray[np.float64]

#: Step of the central difference that differentiates the start of a run, as a share of the direction.
NUDGE = 1e-6


class Loop:
    """The loop of a problem.

    Args:
        problem: The problem.
        laws: Laws in place of the problem's own, one a member.
        period: Duration of a tick in place of the shortest control period, s; all laws run at it.
        refinement: Factor on the number of integration steps.
        compiled: Whether to use machine code; by default wherever it can be made.
    """

    def __init__(
        self, problem: Problem, *, laws: Sequence[Law] | None = None, period: float | None = None,
        refinement: int = 1, compiled: bool | None = None,
    ) -> None:  # fmt: skip
        if period is not None:
            members = tuple(m.under(replace(m.bounds, period=period)) for m in problem.members)
            problem = replace(problem, members=members)
        self.problem, self.refinement, self.compiled = problem, refinement, compiled
        self.period = tick_of(problem)
        self.parts = parts_of(problem, laws or [member.law for member in problem.members], self.period)
        study = problem.study
        self.settings = Settings(transient=study.validation.transient_s, band=study.requirements.band)
        self.batches = Batches(problem, self.parts, self.period)
        self._engines: dict[Any, Engine] = {}
        self._finer: Loop | None = None

    def substeps(self) -> int:
        """Integration steps in a tick."""
        steps = (
            steps_of(m.plant, self.period, [m.bounds.nominal.get(name, 0.0) for name in m.plant.disturbances])
            for m in self.problem.members
        )
        return self.refinement * max(steps)

    def system(self, extras: frozenset[str] = frozenset()) -> System:
        """The loop as symbols; see `compose.py`."""
        return compose(self.problem, self.parts, self.settings, self.period, self.substeps(), extras)

    def engine(self, extras: frozenset[str]) -> Engine:
        """The engine of the loop with what some scenarios need besides: "quantisation", "fault", "ground"."""
        if extras not in self._engines:
            self._engines[extras] = Engine(self.system(extras), compiled=self.compiled)
        return self._engines[extras]

    def figures(self, runs: Sequence[Run], *, duration: float | None = None, jobs: int = 1) -> list[Figures]:
        """Simulate many runs together and keep their figures only.

        Args:
            runs: Gains and scenarios; each run depends on its own alone.
            duration: Length of the runs, s; that of the reference by default.
            jobs: Threads.

        Returns:
            The figures in the order of the runs.
        """
        found: dict[int, Figures] = {}
        for extras in dict.fromkeys(self._extras(run.scenario) for run in runs):
            chosen = [k for k, run in enumerate(runs) if self._extras(run.scenario) == extras]
            engine, batch = self.engine(extras), self.batches.batch([runs[k] for k in chosen], duration)
            outcome = engine.run(batch, jobs=jobs)
            found |= zip(chosen, self._figures(engine, outcome.figures, outcome.lost, batch), strict=True)
        return [found[k] for k in range(len(runs))]

    def _figures(self, engine: Engine, columns: Array, lost: Array, batch: Batch) -> list[Figures]:
        names, count = [record.name for record in engine.system.records], batch.shared.shape[0]
        return [
            figures(dict(zip(names, column, strict=True)), time, self.parts, self.settings, self.period, count)
            for column, time in zip(columns.T.tolist(), lost.tolist(), strict=True)
        ]

    def trace(self, gains: GainSet, scenario: Scenario, *, duration: float | None = None) -> Trace:
        """Simulate one run and keep its signals.

        Args:
            gains: Gains of all members.
            scenario: What the run meets.
            duration: Length of the run, s; that of the reference by default.
        """
        engine = self.engine(self._extras(scenario))
        batch = self.batches.batch([Run(gains=gains, scenario=scenario)], duration)
        found = engine.run(batch, trace=True)
        rows, lost = engine.system.signal_rows(), float(found.lost[0])
        count = batch.shared.shape[0]
        kept = min(count, max(2, round(lost / self.period))) if math.isfinite(lost) else count
        signals = {name: np.ascontiguousarray(found.trace[:kept, rows[name], 0].T) for name in rows}
        firsts: dict[str, int] = dict.fromkeys(("law", "commanded", "errors", "outputs"), 0)

        def own(name: str, size: int) -> Array:
            firsts[name] += size
            return signals[name][firsts[name] - size : firsts[name]]

        members = {}
        for k, part in enumerate(self.parts):
            plant, law = part.law.plant, own("law", part.law.states)
            names = list(plant.outputs)
            members[part.name] = MemberTrace(
                x=signals["x"][part.x], u=own("commanded", len(plant.inputs)), q=own("errors", part.errors),
                z=np.hstack([batch.z[part.z][: part.law.states, :1], law[:, :-1]]),
                r=batch.shared[:kept, 4 * k : 4 * k + 4].T,
                outputs=dict(zip(names, own("outputs", len(names)), strict=True)),
            )  # fmt: skip
        named = {d.name: signals["met"][i] for i, d in enumerate(self.problem.machine.disturbances)}
        return Trace(
            t=self.batches.times(kept), members=members, disturbances=named, place=signals["place"],
            wanted=signals["wanted"], free=self.problem.machine.free, diverged_s=lost,
            body=self._body(signals.get("body")),
        )  # fmt: skip

    def _body(self, rows: Array | None) -> dict[str, Array]:
        """The signals of the machine's body by name."""
        body = self.problem.machine.body
        return {} if rows is None or body is None else dict(zip((*body.states, *body.output_names), rows, strict=True))

    def sensitivities(self, runs: Sequence[Run], directions: Array) -> tuple[list[Figures], Array, Array]:
        """Figures, and the derivatives of the output's RMS error and ITAE along directions of the gains.

        Args:
            runs: Gains and scenarios.
            directions: Directions in the space of all gains, member by member. Shape (d, gains).

        Returns:
            The figures of each run, and derivatives, each of shape (runs, d). One lane of the differentiated loop for
            each run and direction. Not guaranteed: at a kink the derivative is that of one side.

        Raises:
            ValueError: a scenario with a fault, with quantisation or over ground, which is not differentiated.
        """
        if any(run.scenario.quantisation or run.scenario.faults or run.scenario.ground is not None for run in runs):
            raise ValueError(
                "a loop is differentiated without faults, without quantisation and without ground: got a scenario with "
                "them"
            )
        if "derivative" not in self._engines:
            self._engines["derivative"] = Engine(differentiated(self.system()), compiled=self.compiled)
        engine, plain, count = self._engines["derivative"], self.batches.batch(runs), len(directions)
        each, way = np.repeat(np.arange(len(runs)), count), np.tile(np.arange(count), len(runs))
        slopes, first = np.zeros((plain.fixed.shape[0], each.size)), 0
        for part in self.parts:
            size = len(part.law.schema)
            part.constants(slopes)["gains"][:] = directions[way, first : first + size].T
            first += size
        chosen = [runs[int(i)].scenario for i in each]
        moved = [self.batches.starts(plain.fixed[:, each] + sign * NUDGE * slopes, chosen)[0] for sign in (1, -1)]
        batch = Batch(
            fixed=np.vstack([plain.fixed[:, each], slopes]), seeds=plain.seeds[each],
            x=np.vstack([plain.x[:, each], (moved[0] - moved[1]) / (2 * NUDGE)]),
            z=np.vstack([plain.z[:, each], np.zeros((plain.z.shape[0], each.size))]), shared=plain.shared,
            own=lambda lane, first, size: plain.own(int(each[lane]), first, size),
        )  # fmt: skip
        found = engine.run(batch)
        rows = {r.name: found.figures[i].reshape(len(runs), count) for i, r in enumerate(engine.system.records)}
        shown = self._figures(engine, found.figures[:, ::count], found.lost[::count], plain)
        rms = np.array([[m.rms_error_m] for m in shown])
        late = rows["squares"] / rms**2
        return shown, rows["d squares"] / (2 * late * rms), rows["d itae"] * self.period

    def integration_error(self, gains: GainSet, scenario: Scenario) -> float:
        """Estimated error of the integration along a run, m: the change of the output when the steps are halved.

        That change is about 15/16 of the error of the coarser steps (Hairer, Nørsett and Wanner 1993, II.4). Not
        guaranteed: an estimate is no bound, and the run is one run.
        """
        if self._finer is None:
            laws = [part.law for part in self.parts]
            self._finer = Loop(self.problem, laws=laws, refinement=2 * self.refinement, compiled=self.compiled)
        traces = [part.trace(gains, scenario) for part in (self, self._finer)]
        count = min(trace.t.size for trace in traces)
        away = np.linalg.norm(traces[0].place[:, :count] - traces[1].place[:, :count], axis=0)
        return float(away.max()) * 16 / 15

    def demand(self, trace: Trace, gains: GainSet) -> dict[str, float]:
        """The largest norm of the input that each member's law asked for along a run, before the amplitude limit."""
        import casadi as ca

        found = {}
        for member in self.problem.members:
            own, law, plant = trace.members[member.name], member.law, member.plant
            symbols = [ca.SX.sym("x", len(plant.states)), ca.SX.sym("r", 4), ca.SX.sym("z", law.states)]
            load = ca.DM([member.bounds.nominal.get(name, 0.0) for name in plant.disturbances])
            nominal = ca.DM(list(plant.values().values()))
            own_gains, period = ca.DM(list(gains[member.name])), member.bounds.period
            virtual, _ = law.virtual_controls(*symbols, own_gains, nominal, load, period)  # type: ignore[attr-defined]
            wanted = ca.Function("demand", symbols, [ca.vertcat(*(virtual[row] for row in plant.input_map))])
            asked = np.array(wanted.map(trace.t.size)(own.x, own.r, own.z))
            found[member.name] = float(np.linalg.norm(asked, axis=0).max())
        return found

    def _extras(self, scenario: Scenario) -> frozenset[str]:
        """What a run needs of the loop besides."""
        counted = any(step > 0 for part in self.parts for step in part.resolution)
        wanted = {"quantisation": counted or scenario.quantisation > 0, "fault": bool(scenario.faults),
                  "ground": scenario.ground is not None}  # fmt: skip
        return frozenset(name for name, needed in wanted.items() if needed)
