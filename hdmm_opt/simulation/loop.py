"""The closed loop, composed from the symbolic plant and the symbolic law, and run at one control rate.

The plant is integrated by classical Runge-Kutta steps that are finer than the control period; the input and the load
are held over a period. Simulation agrees or disagrees with a proof; it never proves.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from stability import Gains
from trajectories import Reference

from ..control import RAC, gain_columns
from ..plants import Plant
from .compose import compose
from .engine import Batch, Engine
from .metrics import Metrics, Yardstick, metrics
from .scenario import Scenario
from .sensitivity import differentiated
from .system import System

Array = NDArray[np.float64]

#: Longest integration step as a share of the plant's fastest time constant.
STEP_SHARE = 0.35
#: Step of the central difference that differentiates the start of a run, as a share of the direction.
NUDGE = 1e-6
#: A tracking error beyond this, m, ends a run as diverged.
DIVERGED = 1.0


@dataclass(frozen=True, kw_only=True)
class Trace:
    """A simulated run at the control instants.

    Attributes:
        t: Times, s. Shape (k,).
        x: States. Shape (n, k).
        u: Inputs held from each instant on. Shape (m, k).
        q: Errors of the governed rows as the controller computes them. Shape (g, k).
        theta: Adaptive scalars. Shape (g, k).
        r: Reference position … jerk. Shape (4, k).
        load: Load, N. Shape (k,).
        outputs: Further plant signals by name. Each shape (k,).
        diverged: The run ended early because a value was not finite or the error passed `DIVERGED`.
    """

    t: Array
    x: Array
    u: Array
    q: Array
    theta: Array
    r: Array
    load: Array
    outputs: dict[str, Array]
    diverged: bool

    @property
    def error(self) -> Array:
        """True tracking error, m. Shape (k,)."""
        return self.x[0] - self.r[0]


@dataclass(frozen=True, kw_only=True)
class Run:
    """One run: gains that meet a scenario."""

    gains: tuple[Gains, ...]
    scenario: Scenario


@dataclass(frozen=True)
class ClosedLoop:
    """A plant under a law at a control period; compiled once, run with any gains, parameters and scenario.

    Attributes:
        law: The law, with its plant.
        period: Control period, s.
        noise: Bounds on the measurement errors. Shape (n,).
        initial: Bounds on the initial errors of the rows. Shape (n,).
        nominal_load: Load that the modelling terms assume, N.
        yardstick: What the figures are measured by.
        refinement: Factor on the number of integration steps.
        compiled: Whether to use machine code; by default wherever it can be made.
    """

    law: RAC
    period: float
    noise: tuple[float, ...]
    initial: tuple[float, ...]
    nominal_load: float
    yardstick: Yardstick
    refinement: int = 1
    compiled: bool | None = None
    _made: dict[Any, Any] = field(default_factory=dict, repr=False, init=False)

    def substeps(self) -> int:
        """Integration steps in one period."""
        return self.refinement * steps_of(self.law.plant, self.period, self.nominal_load)

    def run(
        self, gains: tuple[Gains, ...], reference: Reference, scenario: Scenario, *, duration: float | None = None
    ) -> Trace:
        """Simulate one scenario from the first instant of the reference.

        Args:
            gains: One for each governed row.
            reference: Followed from t = 0.
            scenario: Load, parameters, noise, quantisation, fault.
            duration: Length of the run, s; that of the reference by default.

        Returns:
            The run. A diverged run is shorter and says so.
        """
        runs = [Run(gains=gains, scenario=scenario)]
        engine = self.engine(_extras(runs[0]))
        batch = self._batch(runs, reference, duration)
        found = engine.run(batch, trace=True)
        lost = float(found.lost[0])
        count = batch.shared.shape[0]
        kept = min(count, max(2, round(lost / self.period))) if math.isfinite(lost) else count
        rows = engine.system.signal_rows()
        signals = {name: np.ascontiguousarray(found.trace[:kept, part, 0].T) for name, part in rows.items()}
        theta = np.hstack([np.zeros((len(gains), 1)), signals["theta"][:, :-1]])
        return Trace(
            t=self._times(count)[:kept], x=signals["x"], u=signals["u"], q=signals["q"], theta=theta,
            r=batch.shared[:kept].T, load=batch.own(0, 0, kept)[0],
            outputs={name: signals[name][0] for name in self.law.plant.outputs}, diverged=math.isfinite(lost),
        )  # fmt: skip

    def figures(
        self, runs: Sequence[Run], reference: Reference, *, duration: float | None = None, jobs: int = 1
    ) -> list[Metrics]:
        """Simulate many runs together and keep their figures only.

        Args:
            runs: Gains and scenarios; each run depends on its own alone.
            reference: Followed from t = 0.
            duration: Length of the runs, s; that of the reference by default.
            jobs: Threads.

        Returns:
            The figures in the order of the runs.
        """
        figures: dict[int, Metrics] = {}
        for extras in dict.fromkeys(_extras(run) for run in runs):
            chosen = [k for k, run in enumerate(runs) if _extras(run) == extras]
            engine, batch = self.engine(extras), self._batch([runs[k] for k in chosen], reference, duration)
            found = engine.run(batch, jobs=jobs)
            figures |= zip(chosen, self._metrics(engine, found.figures, found.lost, batch.shared.shape[0]), strict=True)
        return [figures[k] for k in range(len(runs))]

    def _metrics(self, engine: Engine, figures: Array, lost: Array, count: int) -> list[Metrics]:
        names = [record.name for record in engine.system.records]
        return [
            metrics(dict(zip(names, column, strict=True)), time, self.yardstick, self.period, count)
            for column, time in zip(figures.T.tolist(), lost.tolist(), strict=True)
        ]

    def sensitivities(
        self, runs: Sequence[Run], directions: Array, reference: Reference
    ) -> tuple[list[Metrics], Array, Array]:
        """Figures, and the derivatives of RMS error and ITAE along directions of the gains.

        Args:
            runs: Gains and scenarios.
            directions: Directions in the space of all gains, in the order of `gain_columns`. Shape (d, 4 k).
            reference: Followed from t = 0.

        Returns:
            The figures of each run, and derivatives, each of shape (runs, d). One lane of the differentiated loop for
            each run and direction. Not guaranteed: at a kink the derivative is that of one side.

        Raises:
            ValueError: a scenario with a fault or with quantisation, which has no useful derivative.
        """
        if any(_extras(run) for run in runs):
            raise ValueError(
                "a loop is differentiated without faults and without quantisation: got a scenario with them"
            )
        engine = self._made.setdefault("derivative", Engine(differentiated(self.system()), compiled=self.compiled))
        plain, count = self._batch(runs, reference, None), len(directions)
        each, way = np.repeat(np.arange(len(runs)), count), np.tile(np.arange(count), len(runs))
        slopes = np.zeros((plain.fixed.shape[0], each.size))
        slopes[: directions.shape[1]] = directions[way].T
        start = [
            self._starts_at(plain.fixed[: directions.shape[1], each] + sign * NUDGE * directions[way].T, runs, each,
                            plain.shared[0])
            for sign in (1, -1)
        ]  # fmt: skip
        batch = Batch(
            fixed=np.vstack([plain.fixed[:, each], slopes]), seeds=plain.seeds[each],
            x=np.vstack([plain.x[:, each], (start[0] - start[1]) / (2 * NUDGE)]),
            z=np.zeros((2 * plain.z.shape[0], each.size)), shared=plain.shared,
            own=lambda lane, first, size: plain.own(int(each[lane]), first, size),
        )  # fmt: skip
        found = engine.run(batch)
        rows = {
            record.name: found.figures[i].reshape(len(runs), count) for i, record in enumerate(engine.system.records)
        }
        figures = self._metrics(engine, found.figures[:, ::count], found.lost[::count], plain.shared.shape[0])
        rms = np.array([[m.rms_error_m] for m in figures])
        late = rows["squares"] / rms**2
        return figures, rows["d squares"] / (2 * late * rms), rows["d itae"] * self.period

    def integration_error(self, gains: tuple[Gains, ...], reference: Reference, scenario: Scenario) -> float:
        """Estimated error of the integration along a run, m: the change of the position when the steps are halved.

        That change is about 15/16 of the error of the coarser steps (Hairer, Nørsett and Wanner 1993, II.4). Not
        guaranteed: an estimate is no bound, and the run is one run.
        """
        finer = self._made.setdefault("finer", replace(self, refinement=2 * self.refinement))
        traces = [part.run(gains, reference, scenario) for part in (self, finer)]
        count = min(trace.t.size for trace in traces)
        return float(np.abs(traces[0].x[0, :count] - traces[1].x[0, :count]).max()) * 16 / 15

    def demand(self, trace: Trace, gains: tuple[Gains, ...]) -> float:
        """The largest norm of the input that the law asked for along a run, before the amplitude limit."""
        columns = np.vstack([trace.x, trace.r, trace.theta])
        fixed = np.repeat(np.array(gain_columns(gains)).ravel(order="F")[:, None], trace.t.size, axis=1)
        return float(np.linalg.norm(np.array(self._law()["demand"](columns, fixed)), axis=0).max())

    def engine(self, extras: frozenset[str]) -> Engine:
        """The engine of the loop with what some scenarios need besides: "quantisation", "fault"."""
        if extras not in self._made:
            self._made[extras] = Engine(self.system(extras), compiled=self.compiled)
        return self._made[extras]

    def system(self, extras: frozenset[str] = frozenset()) -> System:
        """The loop as symbols; see `compose.py`."""
        return compose(
            self.law, self.yardstick, self.noise, self.nominal_load, self.period, self.substeps(), DIVERGED, extras
        )

    def _times(self, count: int) -> Array:
        return np.asarray(self.period * np.arange(count), dtype=np.float64)

    def _batch(self, runs: Sequence[Run], reference: Reference, duration: float | None) -> Batch:
        plant = self.law.plant
        count = max(2, round((reference.duration if duration is None else duration) / self.period))
        t = self._times(count)
        r = self._sampled(reference, count)
        bounds = np.array([bound for bound in self.noise if bound > 0])
        columns = []
        for run in runs:
            s = run.scenario
            parameters = [
                p.value * (1 + p.tolerance * s.parameters.get(name, 0.0)) for name, p in plant.parameters.items()
            ]
            random = s.noise * (1 - abs(s.bias)) * (1 - s.quantisation)
            grid = 2 * s.quantisation * np.array(self.noise)
            columns.append(np.concatenate([
                np.array(gain_columns(run.gains)).ravel(order="F"), parameters, bounds * random,
                bounds * s.bias * (1 - s.quantisation), grid, s.fault_column(len(plant.inputs)),
            ]))  # fmt: skip
        z = np.zeros((2 * len(self.law.governed) + 2 * len(plant.inputs), len(runs)))
        return Batch(
            fixed=np.array(columns).T,
            seeds=np.array([seed_of(run.scenario.seed) for run in runs], dtype=np.uint64),
            x=self._starts(runs, r[0]),
            z=z,
            shared=r,
            own=lambda run, first, size: runs[run].scenario.load_at(t[first : first + size])[None, :],
        )

    def _sampled(self, reference: Reference, count: int) -> Array:
        """Position … jerk at the control instants; kept for the reference that was asked for last. Shape (count, 4)."""
        last = self._made.get("reference")
        if last is None or last[0] is not reference or last[1].shape[0] != count:
            last = (reference, np.ascontiguousarray(reference(self._times(count)).T))
            self._made["reference"] = last
        return last[1]

    def _starts(self, runs: Sequence[Run], r: Array) -> Array:
        """The start nearest to rest inside the assumed initial errors; the scenario places the first error.

        Shape (n, runs).
        """
        columns = np.array([np.array(gain_columns(run.gains)).ravel(order="F") for run in runs]).T
        return self._starts_at(columns, runs, np.arange(len(runs)), r)

    def _starts_at(self, columns: Array, runs: Sequence[Run], each: NDArray[np.int64], r: Array) -> Array:
        """The same for other gains, shape (4 k, lanes), of the runs that `each` names. Shape (n, lanes)."""
        n, k = len(self.law.plant.states), len(self.law.governed)
        x = np.zeros((n, each.size))
        x[0] = r[0] + self.initial[0] * np.array([runs[i].scenario.initial for i in each])
        rest = np.vstack([np.repeat(r[:, None], each.size, axis=1), np.zeros((k, each.size))])
        for i in range(1, n):
            target = np.array(self._law()["targets"](np.vstack([x, rest]), columns))[i]
            x[i] = target + np.clip(-target, -self.initial[i], self.initial[i])
        return x

    def _law(self) -> dict[str, Any]:
        """CasADi functions of ([x; r; theta], gains) without the amplitude limit: row targets, and the input."""
        if "law" not in self._made:
            import casadi as ca

            plant, law = self.law.plant, self.law
            n, k = len(plant.states), len(law.governed)
            now, fixed = ca.SX.sym("now", n + 4 + k), ca.SX.sym("gains", 4 * k)
            x, r, theta = now[:n], now[n : n + 4], now[n + 4 :]
            nominal = ca.DM(list(plant.values().values()))
            virtual, _ = law.virtual_controls(x, r, theta, ca.reshape(fixed, k, 4), nominal, self.nominal_load)
            goals = [r[0] if t == "reference" else 0 if t == "zero" else virtual[int(t)] for t in plant.targets]
            wanted = ca.vertcat(*(virtual[row] for row in plant.drives))
            self._made["law"] = {
                "targets": ca.Function("targets", [now, fixed], [ca.vertcat(*goals)]),
                "demand": ca.Function("demand", [now, fixed], [wanted]),
            }
        return self._made["law"]


def _extras(run: Run) -> frozenset[str]:
    """What a run needs of the loop besides."""
    wanted = {"quantisation": run.scenario.quantisation > 0, "fault": run.scenario.fault is not None}
    return frozenset(name for name, needed in wanted.items() if needed)


def steps_of(plant: Plant, period: float, load: float) -> int:
    """Integration steps in one period, from the fastest time constant of a plant at nominal parameters."""
    import casadi as ca

    jacobian = ca.Function("J", [plant.x, plant.u, plant.w, plant.p], [ca.jacobian(plant.rate, plant.x)])
    values = list(plant.values().values())
    at_work = np.array(jacobian([0.3, 0.05] + [0.0] * (len(plant.states) - 2), 0, load, values))
    fastest = float(np.abs(np.linalg.eigvals(at_work)).max())
    return max(2, math.ceil(period * fastest / STEP_SHARE))


def seed_of(seed: int) -> int:
    """A seed of the draws: neighbouring numbers give unrelated streams."""
    return int(np.random.SeedSequence(seed).generate_state(1, np.uint64)[0])
