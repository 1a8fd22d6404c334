"""The closed loop, composed from the symbolic plant and the symbolic law, and run at one control rate.

The plant is integrated by classical Runge-Kutta steps that are finer than the control period; the input and the load
are held over a period. Simulation agrees or disagrees with a proof; it never proves.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from stability import Gains
from trajectories import Reference

from ..control import RAC, gain_columns
from .scenario import Scenario

Array = NDArray[np.float64]

#: Control periods in one call of the compiled loop.
CHUNK = 1000
#: Longest integration step as a share of the plant's fastest time constant.
STEP_SHARE = 0.35
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


@dataclass
class ClosedLoop:
    """A plant under a law at a control period; compiled once, run with any gains, parameters and scenario.

    Attributes:
        law: The law, with its plant.
        period: Control period, s.
        noise: Bounds on the measurement errors. Shape (n,).
        initial: Bounds on the initial errors of the rows. Shape (n,).
        nominal_load: Load that the modelling terms assume, N.
    """

    law: RAC
    period: float
    noise: tuple[float, ...]
    initial: tuple[float, ...]
    nominal_load: float
    _compiled: dict[str, Any] = field(default_factory=dict, repr=False)

    def substeps(self) -> int:
        """Integration steps in one period, from the fastest time constant of the plant at nominal parameters."""
        import casadi as ca

        plant = self.law.plant
        jacobian = ca.Function("J", [plant.x, plant.u, plant.w, plant.p], [ca.jacobian(plant.rate, plant.x)])
        values = list(plant.values().values())
        at_work = np.array(jacobian([0.3, 0.05] + [0.0] * (len(plant.states) - 2), 0, self.nominal_load, values))
        fastest = float(np.abs(np.linalg.eigvals(at_work)).max())
        return max(2, math.ceil(self.period * fastest / STEP_SHARE))

    def run(
        self, gains: tuple[Gains, ...], reference: Reference, scenario: Scenario, *, duration: float | None = None
    ) -> Trace:
        """Simulate one scenario from the first instant of the reference.

        Args:
            gains: One for each governed row.
            reference: Followed from t = 0.
            scenario: Load, parameters, noise.
            duration: Length of the run, s; that of the reference by default.

        Returns:
            The run. A diverged run is shorter and says so.
        """
        plant = self.law.plant
        count = max(2, round((reference.duration if duration is None else duration) / self.period))
        t = np.asarray(self.period * np.arange(count), dtype=np.float64)
        r, load = reference(t), scenario.load_at(t)
        noise = scenario.noise_at(count, np.array(self.noise))
        parameters = np.array([
            p.value * (1 + p.tolerance * scenario.parameters.get(name, 0.0)) for name, p in plant.parameters.items()
        ])  # fmt: skip
        n, k = len(plant.states), len(self.law.governed)
        state = np.concatenate([self._start(gains, r[:, 0], scenario), np.zeros(k)])
        fixed = np.concatenate([np.array(gain_columns(gains)).ravel(order="F"), parameters])
        blocks: list[Array] = []
        diverged = False
        for first in range(0, count, CHUNK):
            last = min(first + CHUNK, count)
            columns = np.vstack([r[:, first:last], load[None, first:last], noise[:, first:last]])
            block = self._advance(state, columns, fixed)
            blocks.append(block)
            state = block[: n + k, -1]
            # a block holds the states after each period, the inputs and errors at its start
            if not np.isfinite(block).all() or not (np.abs(block[0] - r[0, first:last]) < DIVERGED).all():
                diverged = True
                break
        return self._trace(np.hstack(blocks), t, r, load, parameters, gains, scenario, diverged)

    def demand(self, trace: Trace, gains: tuple[Gains, ...]) -> float:
        """The largest norm of the input that the law asked for along a run, before the amplitude limit."""
        wanted = self._law()["demand"].map(trace.t.size)
        columns = np.vstack([trace.x, trace.r, trace.theta])
        fixed = np.repeat(np.array(gain_columns(gains)).ravel(order="F")[:, None], trace.t.size, axis=1)
        return float(np.linalg.norm(np.array(wanted(columns, fixed)), axis=0).max())

    def _start(self, gains: tuple[Gains, ...], r: Array, scenario: Scenario) -> Array:
        """The start nearest to rest inside the assumed initial errors; the scenario places the first error."""
        plant = self.law.plant
        x = np.zeros(len(plant.states))
        x[0] = r[0] + scenario.initial * self.initial[0]
        columns = np.array(gain_columns(gains)).ravel(order="F")
        for i in range(1, len(x)):
            now = np.concatenate([x, r, np.zeros(len(gains))])
            target = float(np.array(self._law()["targets"](now, columns)).ravel()[i])
            x[i] = target + min(max(-target, -self.initial[i]), self.initial[i])
        return x

    def _law(self) -> dict[str, Any]:
        """CasADi functions of ([x; r; theta], gains) without the amplitude limit: row targets, and the input."""
        if "law" not in self._compiled:
            import casadi as ca

            plant, law = self.law.plant, self.law
            n, k = len(plant.states), len(law.governed)
            now, fixed = ca.SX.sym("now", n + 4 + k), ca.SX.sym("gains", 4 * k)
            x, r, theta = now[:n], now[n : n + 4], now[n + 4 :]
            nominal = ca.DM(list(plant.values().values()))
            virtual, _ = law.virtual_controls(x, r, theta, ca.reshape(fixed, k, 4), nominal, self.nominal_load)
            goals = [r[0] if t == "reference" else 0 if t == "zero" else virtual[int(t)] for t in plant.targets]
            wanted = ca.vertcat(*(virtual[row] for row in plant.drives))
            self._compiled["law"] = {
                "targets": ca.Function("targets", [now, fixed], [ca.vertcat(*goals)]),
                "demand": ca.Function("demand", [now, fixed], [wanted]),
            }
        return self._compiled["law"]

    def _advance(self, state: Array, columns: Array, fixed: Array) -> Array:
        size = columns.shape[1]
        key = f"loop{size}"
        if key not in self._compiled:
            self._compiled[key] = self._period_map().mapaccum(key, size)
        out = self._compiled[key](state, columns, np.repeat(fixed[:, None], size, axis=1))
        return np.vstack([np.array(part) for part in out])

    def _period_map(self) -> Any:
        """CasADi function (state, [r; load; noise], [gains; parameters]) -> (state after a period, [u; Q])."""
        if "period" not in self._compiled:
            import casadi as ca

            law, plant = self.law, self.law.plant
            n, k = len(plant.states), len(law.governed)
            state, columns = ca.SX.sym("state", n + k), ca.SX.sym("columns", 5 + n)
            fixed = ca.SX.sym("fixed", 4 * k + plant.p.numel())
            gains, parameters = ca.reshape(fixed[: 4 * k], k, 4), fixed[4 * k :]
            nominal = ca.DM(list(plant.values().values()))
            measured = state[:n] + columns[5:]
            u, theta, q = law.step(
                measured, columns[:4], state[n:], gains, nominal, ca.DM([self.nominal_load]), self.period
            )
            rate = ca.Function("rate", [plant.x, plant.u, plant.w, plant.p], [plant.rate])
            after = _runge_kutta(rate, state[:n], u, columns[4], parameters, self.period, self.substeps())
            self._compiled["period"] = ca.Function(
                "period", [state, columns, fixed], [ca.vertcat(after, theta), ca.vertcat(u, q)]
            )
        return self._compiled["period"]

    def _trace(
        self, block: Array, t: Array, r: Array, load: Array, parameters: Array, gains: tuple[Gains, ...],
        scenario: Scenario, diverged: bool,
    ) -> Trace:  # fmt: skip
        plant = self.law.plant
        n, k, m, count = len(plant.states), len(self.law.governed), len(plant.inputs), block.shape[1]
        start = np.concatenate([self._start(gains, r[:, 0], scenario), np.zeros(k)])
        states = np.hstack([start[:, None], block[: n + k, :-1]])
        u, q = block[n + k : n + k + m], block[n + k + m :]
        return Trace(
            t=t[:count], x=states[:n], u=u, q=q, theta=states[n:], r=r[:, :count], load=load[:count],
            outputs=self._outputs(states[:n], u, load[:count], parameters), diverged=diverged,
        )  # fmt: skip

    def _outputs(self, x: Array, u: Array, load: Array, parameters: Array) -> dict[str, Array]:
        if "outputs" not in self._compiled:
            import casadi as ca

            plant = self.law.plant
            self._compiled["outputs"] = ca.Function(
                "outputs", [plant.x, plant.u, plant.w, plant.p], [ca.vertcat(*plant.outputs.values())]
            )
        mapped = self._compiled["outputs"].map(x.shape[1])
        values = np.array(mapped(x, u, load[None, :], np.repeat(parameters[:, None], x.shape[1], axis=1)))
        return dict(zip(self.law.plant.outputs, values, strict=True))


def _runge_kutta(rate: Any, x: Any, u: Any, w: Any, p: Any, period: float, steps: int) -> Any:
    """Classical fourth-order steps over one period with held input and load."""
    h = period / steps
    for _ in range(steps):
        k1 = rate(x, u, w, p)
        k2 = rate(x + h / 2 * k1, u, w, p)
        k3 = rate(x + h / 2 * k2, u, w, p)
        k4 = rate(x + h * k3, u, w, p)
        x = x + h / 6 * (k1 + 2 * k2 + 2 * k3 + k4)
    return x
