"""Robust adaptive control (RAC) for strict-feedback plants: one definition for any number of subsystems.

    Q_i = x_i - target_i,   κ_i = -(β_i + ε_i θ̂_i) Q_i / 2 - φ̂_i + m_i,   θ̂_i' = -δ_i σ_i θ̂_i + ε_i δ_i Q_i² / 2
    φ̂_i <- φ̂_i + T γ_i Q_i, kept within ±Φ_i, and left where the limited input would be pushed further into its limit

In the row of an input, behind which the plant has lags and modes that nobody measures, the proportional part acts on
Q_i through sections of lead (1 + a s)/(1 + f s); `stability/loops/lead.py` has them sampled. They start at zero.

The target of a row is the reference, zero, or the virtual control κ of another row; the input is the κ of the last
row. The modelling terms m_i are zero in the model-free law, but for m_1 = x_1d' where x_1' = x_2, a position. The
model-based law fills them in; see `modelling.py`. φ̂_i is the load network of P-4: it finds the demand that nothing else
covers, a load above all. γ_i = 0 switches it off.

Source: Heydari Shahna (2025), ch. 4, and P-1, P-4; sampled form and load network derived here.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from stability import Gains, LoopModel, Row, from_casadi

from ..plants import Plant
from .law import GainSpec, limited
from .modelling import check_modelling, modelling_term

#: Ratio of the highest bandwidths of successive rows, and the lowest over the highest, where a study gives no range.
SEPARATION, NARROWEST = 3.0, 1 / 500
#: Gains of a controlled row: meaning, and value where a study leaves it out.
KINDS: dict[str, tuple[str, float | None]] = {
    "beta": ("proportional gain", None),
    "epsilon": ("adaptation gain", 0.0),
    "delta": ("adaptation rate", 1.0),
    "sigma": ("leakage of the adaptation", 1.0),
    "gamma": ("gain of the load network", 0.0),
    "phi": ("largest estimate of the load network", None),
    "preload": ("estimate of the load network at the start", None),
}
#: Gains of a row.
COUNT = len(KINDS)
#: Gains of the leads of an input: meaning.
LEADS = {"lead": "time of each section of lead", "smooth": "time of their filters"}


@dataclass(frozen=True, kw_only=True)
class RAC:
    """The law for one plant.

    Attributes:
        plant: The plant.
        modelling: Which modelling terms the law holds; see `modelling.py`.

    Raises:
        ValueError: a modelling term that is unknown, or that the plant has no row for.
    """

    plant: Plant
    modelling: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        check_modelling(self.plant, self.modelling)

    @property
    def rows(self) -> tuple[Row, ...]:
        """The subsystems, in strict-feedback order."""
        plant = self.plant
        columns = zip(plant.states, plant.state_units, plant.targets, plant.controlled, strict=True)
        return tuple(Row(state=s, unit=u, target=t, controlled=g) for s, u, t, g in columns)

    @property
    def controlled(self) -> tuple[int, ...]:
        """Indices of the rows that carry gains."""
        return tuple(i for i, on in enumerate(self.plant.controlled) if on)

    def terms(self, x: Any, r: Any, nominal: Any, load: Any) -> list[Any]:
        """The modelling terms m_i of the controlled rows.

        Args:
            x: Measured states. Shape (n,).
            r: Reference position … jerk. Shape (4,).
            nominal: Nominal parameters. Shape of plant.p.
            load: Nominal disturbances. Shape of plant.w.

        Returns:
            One expression for each controlled row.
        """
        return [self._term(i, x, r, nominal, load) for i in self.controlled]

    def _term(self, i: int, x: Any, r: Any, nominal: Any, load: Any) -> Any:
        if self.rows[i].target == "reference" and self.plant.first == "position":
            return r[1]
        return modelling_term(self.plant, self.modelling, i, x, r, nominal, load)

    @property
    def schema(self) -> tuple[GainSpec, ...]:
        """β, ε, δ, σ, γ, Φ and φ̂(0) of each controlled row; a and f of the leads of each input."""
        found = []
        for k, row in enumerate(self.controlled):
            state = self.plant.states[row]
            for kind, (meaning, default) in KINDS.items():
                found.append(GainSpec(
                    name=f"{kind}_{k + 1}", unit=self._unit(row, kind), default=default,
                    zero=kind not in ("beta", "delta", "sigma"), signed=kind == "preload",
                    meaning=f"{meaning} of subsystem {k + 1} ({state})",
                ))  # fmt: skip
        for row in self._led:
            k = self.controlled.index(row) + 1
            found += [
                GainSpec(
                    name=f"{kind}_{k}",
                    unit="s",
                    default=0.0,
                    zero=True,
                    meaning=f"{meaning} of subsystem {k} ({self.plant.states[row]})",
                )
                for kind, meaning in LEADS.items()
            ]
        return tuple(found)

    @property
    def _led(self) -> tuple[int, ...]:
        """Rows with sections of lead."""
        return self.plant.input_map if self.plant.leads else ()

    def _unit(self, row: int, kind: str) -> str:
        """Units: β maps Q_i to κ_i, ε θ̂ has the unit of β, θ̂ that of ε Q² / (2σ)."""
        own = self.rows[row].unit
        followers = [r.unit for r in self.rows if r.target == row]
        control = followers[0] if followers else self.plant.input_unit
        if kind in ("delta", "sigma"):
            return "1" if kind == "delta" else "1/s"
        if kind in ("phi", "preload"):
            return control
        ratio = f"({control})/({own})"
        if kind == "gamma":
            return f"{ratio}/s"
        return ratio if kind == "beta" else f"sqrt({ratio}/s)/({own})"

    def derived(self, rate: float, initial: Sequence[float]) -> dict[str, tuple[float, float]]:
        """Ranges of the β that a study leaves out, from inertia, rate and limits.

        A row's bandwidth ω = g β / (2 M) is searched between a fifth of a percent and all of the highest that sampling
        leaves it: half the rate for the row of the input, and `SEPARATION` times less for each row before it. Where a
        state has a limit, the initial error alone does not ask for more than that.

        Args:
            rate: Control rate, Hz.
            initial: Bounds on the initial errors. Shape (n,).
        """
        plant, found = self.plant, {}
        own = {limit.signals[0]: limit.value for limit in plant.limits if len(limit.signals) == 1}
        for k, i in enumerate(self.controlled):
            fastest = rate / 2 / SEPARATION ** self._behind(i)
            scale = 2 * plant.inertia_over_gain(i)
            low, high = scale * fastest * NARROWEST, scale * fastest
            followers = [plant.states[j] for j, target in enumerate(plant.targets) if target == i]
            driven = [plant.inputs[plant.input_map.index(i)]] if i in plant.input_map else followers[:1]
            limit = own.get(driven[0]) if driven else None
            largest = next((entry.value for entry in plant.limits if set(driven[:1]) & set(entry.signals)), 0.0)
            found[f"phi_{k + 1}"] = (largest, largest)
            found[f"preload_{k + 1}"] = (0.0, 0.0)
            if limit is not None and initial[i] > 0:
                high = max(min(high, 2 * limit / initial[i]), 2 * low)
            found[f"beta_{k + 1}"] = (float(f"{low:.3g}"), float(f"{high:.3g}"))
        return found

    def _behind(self, i: int) -> int:
        """Controlled rows between a row and the input."""
        following = [j for j in self.controlled if self.plant.targets[j] == i]
        return 1 + self._behind(following[0]) if following else 0

    @property
    def states(self) -> int:
        """An adaptive scalar and a load network for each controlled row; every section of lead."""
        return 2 * len(self.controlled) + self.plant.leads * len(self._led)

    def start(self, x: Sequence[float], gains: Sequence[float]) -> list[float]:
        """All load networks start at their preload, adaptive scalars and leads at zero."""
        count = len(self.controlled)
        preloads = [gains[k] for k in range(COUNT - 1, COUNT * count, COUNT)]
        return [0.0] * count + preloads + [0.0] * (self.states - 2 * count)

    def rows_of(self, values: Sequence[float]) -> tuple[Gains, ...]:
        """A vector of gains as the prover takes them."""
        names = [{"phi": "capacity"}.get(kind, kind) for kind in KINDS]
        found = []
        for k, row in enumerate(self.controlled):
            own = dict(zip(names, values[COUNT * k : COUNT * (k + 1)], strict=True))
            if row in self._led:
                own |= dict(zip(LEADS, self._times(row, values), strict=True))
            found.append(Gains(**own))
        return tuple(found)

    def _times(self, row: int, gains: Any) -> tuple[Any, Any]:
        """A and f of the leads of a row, s."""
        first = COUNT * len(self.controlled) + len(LEADS) * self._led.index(row)
        return gains[first], gains[first + 1]

    def step(self, x: Any, r: Any, z: Any, gains: Any, nominal: Any, load: Any, period: float) -> Any:
        """One control period, as expressions; arguments as in `control/law.py`.

        Returns:
            (u, θ̂, φ̂ and w after the period, Q): inputs inside the amplitude limit, shape (m,); shape (states,); errors
            of the controlled rows, shape (k,).
        """
        import casadi as ca

        virtual, errors, remembered = self._controls(x, r, z, gains, nominal, load, period)
        asked = ca.vertcat(*(virtual[row] for row in self.plant.input_map))
        u = limited(self.plant, asked)
        adapted, learned, count = [], [], len(errors)
        for k, (row, error) in enumerate(zip(self.controlled, errors, strict=True)):
            _, epsilon, delta, sigma, gamma, phi, _ = (gains[COUNT * k + column] for column in range(COUNT))
            adapted.append(z[k] + period * (epsilon * delta * error**2 / 2 - delta * sigma * z[k]))
            own = self._input_of(row)
            # an increment lowers κ, and with it the input at the end of the chain
            further = -error * asked[own] > 0
            held = ca.logic_and(ca.fabs(asked[own]) > ca.fabs(u[own]), further)
            estimate = z[count + k] + ca.if_else(held, 0, period * gamma * error)
            learned.append(ca.fmin(ca.fmax(estimate, -phi), phi))
        return u, ca.vertcat(*adapted, *learned, *remembered), ca.vertcat(*errors)

    def _input_of(self, row: int) -> int:
        """The input at the end of the chain that a row begins."""
        following = next((j for j in self.controlled if self.plant.targets[j] == row), None)
        return self.plant.input_map.index(row) if following is None else self._input_of(following)

    def virtual_controls(
        self, x: Any, r: Any, z: Any, gains: Any, nominal: Any, load: Any, period: float = math.inf
    ) -> tuple[dict[int, Any], list[Any]]:
        """κ_i by row, and Q_i of the controlled rows, before the amplitude limit; arguments as in `step`.

        Without a period leads pass an error on as it is, as they do once it has stood for long.
        """
        return self._controls(x, r, z, gains, nominal, load, period)[:2]

    def _controls(
        self, x: Any, r: Any, z: Any, gains: Any, nominal: Any, load: Any, period: float
    ) -> tuple[dict[int, Any], list[Any], list[Any]]:
        """The same, and what the leads remember after a period."""
        terms = self.terms(x, r, nominal, load)
        virtual: dict[int, Any] = {}
        errors: list[Any] = []
        remembered: list[Any] = []
        for k, i in enumerate(self.controlled):
            target = self.rows[i].target
            goal = virtual[target] if isinstance(target, int) else r[0] if target == "reference" else 0
            errors.append(x[i] - goal)
            first, count = COUNT * k, len(self.controlled)
            acting = errors[-1]
            if i in self._led and period < math.inf:
                place = 2 * count + len(remembered)
                own = [z[place + j] for j in range(self.plant.leads)]
                acting, following = _led(acting, own, *self._times(i, gains), period)
                remembered += following
            proportional = -(gains[first] + gains[first + 1] * z[k]) * acting / 2
            virtual[i] = proportional + terms[k] - z[count + k]
        return virtual, errors, remembered

    def loop_model(self) -> LoopModel:
        """Plant and law as data for the prover."""
        import casadi as ca

        plant = self.plant
        r, nominal, load = ca.SX.sym("r", 4), ca.SX.sym("nominal", plant.p.numel()), ca.SX.sym("load", plant.w.numel())
        plant_names = (*plant.states, *plant.inputs, *plant.disturbances, *plant.parameters)
        law_names = (*plant.states, "r0", "r1", "r2", "r3", *(f"nominal.{n}" for n in plant.parameters))
        law_names += tuple(f"nominal.{n}" for n in plant.disturbances)
        plant_input = ca.vertcat(plant.x, plant.u, plant.w, plant.p)
        law_input = ca.vertcat(plant.x, r, nominal, load)
        return LoopModel(
            rows=self.rows,
            input_map=plant.input_map,
            inputs=plant.inputs,
            leads=plant.leads,
            plant=from_casadi(ca.Function("plant", [plant_input], [ca.vertcat(plant.mass, plant.force)]), plant_names),
            law=tuple(
                from_casadi(ca.Function("term", [law_input], [term]), law_names)
                for term in self.terms(plant.x, r, nominal, load)
            ),
        )


def _led(error: Any, own: Sequence[Any], lead: Any, smooth: Any, period: float) -> tuple[Any, list[Any]]:
    """What the last section of lead gives, and what all remember."""
    every, following = smooth + period, []
    for w in own:
        following.append((smooth * w + period * error) / every)
        error = ((lead + period) * error + (smooth - lead) * w) / every
    return error, following


LAW = RAC
