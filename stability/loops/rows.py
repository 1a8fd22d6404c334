"""The closed loop in error coordinates: M_i Q_i' = sum_j S_ij Q_j + d_i with everything enclosed in intervals.

Theory §3, with the couplings a, the unsigned bounds L and the gains g gathered in one interval matrix S, and each row
multiplied by its constant unknown inertia M_i, which then enters only between V and |Q_i|.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..enclosures.form import ONE, Form, Symbols, Value, evaluate, tangent
from ..enclosures.interval import Interval
from .balance import STEPS, WIDER, Balance, balance
from .model import ALONE, CONSTANT, SIGNALS, Bounds, Gains, LoopModel, Row, balance_of

Array = NDArray[np.float64]

#: A parameter that may change in a run: faults take effectiveness.
VARYING = "effectiveness"
#: Range and rate of what is not there.
STILL = (Interval(0.0), Interval(0.0))


@dataclass(frozen=True, kw_only=True)
class ErrorRows:
    """Enclosures that hold while |Q_i| <= half_widths_i and the input differs from its κ by at most `input_bound`.

    Attributes:
        low: Lower ends of S. Shape (n, n).
        high: Upper ends of S. Shape (n, n).
        disturbance: Bounds D_i on |d_i|. Shape (n,).
        mass_low: Lower ends of M. Shape (n,).
        mass_high: Upper ends of M. Shape (n,).
        control_gain: Lower ends of g_i, the effect of the own virtual control (0 where a row has none). Shape (n,).
        theta_max: Bounds on the adaptive scalars. Shape (n,).
        theta_residual: Bounds on what sampling and noise add to the adaptation. Shape (n,).
        input_bound: What the sampling and the noise make of the input error. Shape (m,).
        effort: Bounds on the inputs |u_k|. Shape (m,).
        states: Bounds on |x_i|. Shape (n,).
    """

    low: Array
    high: Array
    disturbance: Array
    mass_low: Array
    mass_high: Array
    control_gain: Array
    theta_max: Array
    theta_residual: Array
    input_bound: Array
    effort: Array
    states: Array


def error_rows(
    model: LoopModel, bounds: Bounds, gains: tuple[Gains, ...], half_widths: Array, input_bound: Array
) -> ErrorRows:
    """Enclose the closed loop over the box |Q_i| <= half_widths_i.

    Args:
        model: Plant and law.
        bounds: Assumptions.
        gains: One for each controlled row, in order.
        half_widths: Half widths of the box, in the units of the states. Shape (n,).
        input_bound: Assumed bounds on |u_k - κ_k(t)|. Shape (m,).

    Returns:
        The enclosures.

    Raises:
        ZeroDivisionError: a divisor of the model can vanish in the box.
        ValueError: a modelling term reads the jerk r3, whose rate has no bound.

    Not guaranteed: that the box is invariant, or that `input_bound` is large enough. The caller checks both.
    """
    return Builder(model, bounds, gains, half_widths, input_bound).build()


class Builder:
    """One pass over the rows, in the order in which they track each other."""

    def __init__(
        self, model: LoopModel, bounds: Bounds, gains: tuple[Gains, ...], half_widths: Array, input_bound: Array
    ) -> None:
        self.model, self.bounds, self.half_widths = model, bounds, [float(r) for r in half_widths]
        self.gains = dict(zip(model.controlled, gains, strict=True))
        self.terms = dict(zip(model.controlled, model.law, strict=True))
        if any("r3" in term.inputs for term in model.law):
            raise ValueError("a modelling term must not read the jerk r3: its rate has no bound; use r0, r1, r2")
        self.symbols = Symbols()
        for k, interval in enumerate(bounds.reference):
            self.symbols.ranges[f"r{k}"] = interval
        for i, radius in enumerate(self.half_widths):
            self.symbols.ranges[f"Q{i}"] = Interval.symmetric(radius)
        for k, error in enumerate(input_bound):
            self.symbols.ranges[f"e{k}"] = Interval.symmetric(float(error))
        self.inputs: dict[str, Value] = {}
        for name, number in bounds.nominal.items():
            self.inputs[f"nominal.{name}"] = self.symbols.constant(Interval(number), name)
        for name, interval in bounds.parameters.items():
            self.inputs[name] = self._changing(name, interval) if name == VARYING else self._fixed(name, interval)
        for name, interval in bounds.disturbances.items():
            if name not in bounds.feedforward:
                self.inputs[name] = self._changing(name, interval)
        for name, (value, _) in bounds.feedforward.items():
            symbol = f"w:{name}"
            self.symbols.ranges[symbol] = value
            if name not in bounds.nominal:
                self.inputs[f"nominal.{name}"] = self.symbols.value(f"nominal.{name}", Form.of(symbol))
            beside = Form.of(symbol) + self._changing(name, bounds.disturbances[name]).form
            self.inputs[name] = self.symbols.value(name, beside)
        self.rated = {**bounds.feedforward}
        for name in model.quotients:
            self._quotient(name, *name.split("/", 1))
        for k in range(4):
            self.inputs[f"r{k}"] = self.symbols.value(f"r{k}", Form.of(f"r{k}"))
        self.balances = {i: self._balance(i, k) for i, k in model.balanced.items()}
        self.noise: dict[int, float] = {}
        self.theta_max: dict[int, float] = {}
        self.theta_rate: dict[int, float] = {}
        self.half_gain: dict[int, Interval] = {}
        self.model_term: dict[int, Form] = {}

    def _balance(self, i: int, k: int) -> Balance:
        """What row i carries so that row k moves as is asked for: a signal of bounded rate."""
        model, rates = self.model, self._rates_of_signals()
        n, name = len(model.rows), balance_of(model.rows[i].state)
        own, row = f"w:{name}", model.rows[k]
        if row.target not in ALONE:
            raise ValueError(f"a balance is of a row that tracks the reference: got {row.state}")
        program = model.program.only([model.plant.outputs[j] for j in (k, n + k)])
        span = Interval(0.0)
        for _ in range(STEPS):
            symbols = self.symbols.copy()
            symbols.ranges[own] = span
            inputs = {
                **self.inputs,
                model.rows[i].state: symbols.value(model.rows[i].state, Form({f"Q{i}": ONE, own: ONE})),
            }
            inputs[row.state] = symbols.value(
                row.state, Form({f"Q{k}": ONE, **{s: Interval(v) for s, v in row.place.items()}})
            )
            mass, force = evaluate(program, inputs, symbols)
            found = balance(force.form, own, mass.range, self._rate_of(row), rates, symbols)
            needed = found.range(symbols.ranges)
            if span.low <= needed.low and needed.high <= span.high:
                self.symbols.ranges[own], self.rated[name] = span, (span, found.rate(rates))
                return found
            span = needed + Interval.symmetric(WIDER * needed.magnitude)
        raise ValueError(f"what {model.rows[i].state} carries does not settle")

    def _rate_of(self, row: Row) -> Form:
        """The rate of the target of a row that tracks nothing but the reference."""
        return Form({f"r{int(s[1]) + 1}": Interval(v) for s, v in row.place.items()})

    def _rates_of_signals(self) -> dict[str, Interval]:
        """Rate of each signal whose rate is bounded."""
        ranges = self.bounds.reference
        return {f"r{k}": ranges[k + 1] for k in range(3)} | {
            f"w:{name}": rate for name, (_, rate) in self.rated.items()
        }

    def _quotient(self, name: str, load: str, parameter: str) -> None:
        """A disturbance of bounded rate over a constant, which is another one."""
        if parameter == VARYING or load not in self.bounds.feedforward:
            raise ValueError(f"a state that follows {name} needs a bound on the rate of {load}")
        by = ONE / self.bounds.parameters[parameter]
        span, rate = (part * by for part in self.bounds.feedforward[load])
        self.rated[name], self.symbols.ranges[f"w:{name}"] = (span, rate), span
        beside = self._changing(name, self.bounds.disturbances[load] * by)
        self.inputs[name] = self.symbols.value(name, Form.of(f"w:{name}") + beside.form)

    def _fixed(self, name: str, interval: Interval) -> Value:
        return self.symbols.constant(interval, name)

    def _changing(self, name: str, interval: Interval) -> Value:
        """What may change at any time: a symbol, so that the coefficients of others stay constant."""
        if interval.is_point:
            return self._fixed(name, interval)
        self.symbols.ranges[f"d:{name}"] = interval
        return self.symbols.value(name, Form.of(f"d:{name}"))

    def build(self) -> ErrorRows:
        """The enclosures."""
        n = len(self.model.rows)
        self._states()
        values = self._plant()
        masses = [values[i].range for i in range(n)]
        forces = [self.symbols.expand(values[n + i].form, keep="K") for i in range(n)]
        rates = [forces[i].scaled(ONE / masses[i]) for i in range(n)]
        rows, virtual_rates = self._rows(forces, masses, rates)
        closed = [self.symbols.expand(row) for row in rows]
        own = [rows[i].coefficient(f"K{i}").low if i in self.gains else 0.0 for i in range(n)]
        input_bound = [self._held(row, virtual_rates[row]) for row in self.model.input_map]
        return ErrorRows(
            low=np.array([[c.coefficient(f"Q{j}").low for j in range(n)] for c in closed]),
            high=np.array([[c.coefficient(f"Q{j}").high for j in range(n)] for c in closed]),
            disturbance=np.array([self._disturbance(c) for c in closed]),
            mass_low=np.array([m.low for m in masses]),
            mass_high=np.array([m.high for m in masses]),
            control_gain=np.array(own),
            theta_max=np.array([self.theta_max.get(i, 0.0) for i in range(n)]),
            theta_residual=np.array([self._residual(i, closed[i], masses[i]) for i in range(n)]),
            input_bound=np.array(input_bound),
            effort=np.array([self._effort(row) for row in self.model.input_map]),
            states=np.array([self.inputs[row.state].range.magnitude for row in self.model.rows]),
        )

    def _states(self) -> None:
        """Forms of the states, row by row: x_i = target_i + Q_i; and of the modelling terms once their inputs exist."""
        for i, row in enumerate(self.model.rows):
            form = Form.of(f"Q{i}") + self._target(i)
            self.inputs[row.state] = self.symbols.value(row.state, form)
        for i in self.gains:
            self._virtual_control(i)

    def _target(self, i: int) -> Form:
        row = self.model.rows[i]
        if isinstance(row.target, int):
            self._virtual_control(row.target)
            return self._control(row.target)
        found = Form()
        for name, share in row.place.items():
            found = found + self._signal(name).scaled(Interval(share))
        return found

    def _signal(self, name: str) -> Form:
        """A derivative of the reference, one; or a disturbance, its middle where its rate has no bound."""
        if name == CONSTANT:
            return Form(constant=ONE)
        if name in SIGNALS:
            return Form.of(name)
        if name in self.rated:
            return Form.of(f"w:{name}")
        if name not in self.bounds.disturbances:
            raise ValueError(f"a target is made of r0, r1, r2, constant and disturbances: got {name}")
        span = self.inputs[name].range
        return Form(constant=Interval((span.low + span.high) / 2))

    def _virtual_control(self, i: int) -> None:
        """Bounds on θ̂_i, the gain interval [½β, ½B], the symbol K_i and the modelling term m_i."""
        if i in self.half_gain:
            return
        gains = self.gains[i]
        noise = self._noise(i)
        peak = (self._error(i) + noise) ** 2
        theta = gains.epsilon * peak / (2.0 * gains.sigma) * (1 + 1e-12)
        rate = max(gains.delta * gains.sigma * theta, 0.5 * gains.epsilon * gains.delta * peak) * (1 + 1e-12)
        half = Interval(0.5) * Interval(gains.beta, gains.beta + gains.epsilon * theta * (1 + 1e-12))
        self.theta_max[i], self.theta_rate[i], self.half_gain[i] = theta, rate, half
        definition = Form({f"Q{i}": -half})
        self.symbols.definitions[f"K{i}"] = definition
        self.symbols.ranges[f"K{i}"] = self.symbols.range_of(definition)
        self.model_term[i] = evaluate(self.terms[i], self.inputs, self.symbols)[0].form

    def _error(self, i: int) -> float:
        """Bound on |Q_i|."""
        return self.half_widths[i]

    def _noise(self, i: int) -> float:
        """Bound on the error of the Q_i that the controller computes."""
        target = self.model.rows[i].target
        own = self.bounds.noise[i]
        if not isinstance(target, int):
            self.noise[i] = own
            return own
        self.noise[i] = (own + self._control_noise(target)) * (1 + 1e-12)
        return self.noise[i]

    def _ranges(self) -> dict[str, Interval]:
        """Input ranges of the law, widened by the measurement noise."""
        ranges = {name: value.range for name, value in self.inputs.items()}
        for row, noise in zip(self.model.rows, self.bounds.noise, strict=True):
            if row.state in ranges:
                ranges[row.state] = ranges[row.state] + Interval.symmetric(noise)
        return ranges

    def _term_noise(self, i: int) -> float:
        tangents = {
            row.state: Form(constant=Interval.symmetric(noise))
            for row, noise in zip(self.model.rows, self.bounds.noise, strict=True)
        }
        return tangent(self.terms[i], self._ranges(), tangents).constant.magnitude

    def _control(self, row: int) -> Form:
        """The part of an input that is not its error e."""
        return Form.of(f"K{row}") + self.model_term[row]

    def _plant(self) -> list[Value]:
        for k, (name, row) in enumerate(zip(self.model.inputs, self.model.input_map, strict=True)):
            form = self._control(row) + Form.of(f"e{k}")
            self.inputs[name] = self.symbols.value(name, form)
        return evaluate(self.model.program, self.inputs, self.symbols)

    def _rows(
        self, forces: list[Form], masses: list[Interval], rates: list[Form]
    ) -> tuple[list[Form], dict[int, Form]]:
        tangents = {row.state: rates[i] for i, row in enumerate(self.model.rows)}
        tangents.update({f"r{k}": Form.of(f"r{k + 1}") for k in range(3)})
        tangents.update({f"nominal.{n}": Form(constant=rate) for n, (_, rate) in self.bounds.feedforward.items()})
        ranges = self._ranges()
        rows: list[Form] = []
        virtual: dict[int, Form] = {}
        self.target_rate: list[Form] = []
        for i, row in enumerate(self.model.rows):
            target_rate = virtual[row.target] if isinstance(row.target, int) else Form()
            for name, share in row.place.items():
                rate = tangents[name] if name in SIGNALS else Form(constant=self.rated.get(name, STILL)[1])
                target_rate = target_rate + rate.scaled(Interval(share))
            self.target_rate.append(target_rate)
            rows.append(forces[i] - target_rate.scaled(masses[i]))
            if i in self.gains:
                term_rate = self.symbols.expand(tangent(self.terms[i], ranges, tangents), keep="K")
                virtual[i] = self._virtual_rate(i, rows[i].scaled(ONE / masses[i])) + term_rate
        return rows, virtual

    def _virtual_rate(self, i: int, error_rate: Form) -> Form:
        adaptation = Interval.symmetric(0.5 * self.gains[i].epsilon * self.theta_rate[i] * (1 + 1e-12))
        return error_rate.scaled(-self.half_gain[i]) + Form({f"Q{i}": adaptation})

    def _held(self, row: int, virtual_rate: Form) -> float:
        """T_s sup|κ'| plus the noise that reaches the input."""
        sup = self.symbols.range_of(self.symbols.expand(virtual_rate)).magnitude
        return (self.bounds.period * sup + self._control_noise(row)) * (1 + 1e-12)

    def _control_noise(self, row: int) -> float:
        """What measurement errors make of κ."""
        return self.half_gain[row].high * self.noise[row] + self._term_noise(row)

    def _effort(self, row: int) -> float:
        return (self.symbols.range_of(self._control(row)).magnitude + self._control_noise(row)) * (1 + 1e-12)

    def _disturbance(self, form: Form, moving: str = "Q") -> float:
        rest = {s: c for s, c in form.coefficients.items() if s[0] not in moving}
        return self.symbols.range_of(Form(rest, form.constant)).magnitude

    def _residual(self, i: int, row: Form, mass: Interval) -> float:
        if i not in self.gains:
            return 0.0
        gains = self.gains[i]
        speed = self.symbols.range_of(row).magnitude / mass.low
        error = self.bounds.period * speed + self.noise[i]
        squares = 0.5 * gains.epsilon * gains.delta * error * (2.0 * self.half_widths[i] + error)
        return gains.delta * gains.sigma * self.bounds.period * self.theta_rate[i] + squares
