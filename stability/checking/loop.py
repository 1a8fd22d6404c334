"""The closed loop in error coordinates: M_i Q_i' = sum S_ij Q_j + d_i over the assumed box.

Obligations: composition, sampling, adaptation. Must fail: a sign of plant or law, a smaller box, more noise.
"""

from __future__ import annotations

from fractions import Fraction

from .arithmetic import ONE, ZERO, Interval, add, down, inverse, magnitude, neg, symmetric, up
from .claim import Claim, Gain
from .forms import Form, Node, Table, derivative, linear, plus, times
from .limits import NotProvedError, need
from .parsing import reads


class Loop:
    """M_i Q_i' = sum_j S_ij Q_j + d_i over the assumed box, with every entry an interval."""

    moving = "Q"

    def __init__(self, claim: Claim, inflate: Fraction) -> None:
        self.claim, self.table = claim, Table()
        self.gain: dict[int, Gain] = {}
        for i, values in zip(claim.controlled, claim.gains, strict=True):
            self.gain[i] = Gain(*((v * (1 - inflate), v * (1 + inflate)) for v in values))
        self.term = dict(zip(claim.controlled, claim.law, strict=True))
        self.theta: dict[int, Fraction] = {}
        self.theta_rate: dict[int, Fraction] = {}
        self.half: dict[int, Interval] = {}
        self.noise: dict[int, Fraction] = {}
        self.model: dict[int, Form] = {}
        self.nodes: dict[str, Node] = {}
        self.virtual: dict[int, Form] = {}
        self._inputs()
        self._rows()

    def _inputs(self) -> None:
        claim, table = self.claim, self.table
        fixed = {f"nominal.{name}": (value, value) for name, value in claim.nominal.items()}
        for name, bounds in {**fixed, **claim.parameters, **claim.disturbances}.items():
            key = ("const", bounds[0]) if bounds[0] == bounds[1] else ("input", name)
            self.nodes[name] = Node(table.key(*key), {"": bounds}, bounds)
        for name, (bounds, _) in claim.feedforward.items():
            table.ranges[f"w:{name}"] = bounds
            self._name(f"nominal.{name}", {f"w:{name}": ONE})
            self._name(name, {f"w:{name}": ONE, "": claim.disturbances[name]})
        for k, bounds in enumerate(claim.reference):
            table.ranges[f"r{k}"] = bounds
            self._name(f"r{k}", {f"r{k}": ONE})
        for i, radius in enumerate(claim.half_widths):
            table.ranges[f"Q{i}"] = symmetric(radius)
        for k, error in enumerate(claim.input_bound):
            table.ranges[f"e{k}"] = symmetric(error)
        for i, row in enumerate(claim.rows):
            self._name(row["state"], plus({f"Q{i}": ONE}, self._target(i)))
        for i in self.gain:
            self._control(i)
        for k, (name, row) in enumerate(zip(claim.inputs, claim.input_map, strict=True)):
            self._name(name, plus(self._kappa(row), {f"e{k}": ONE}))

    def _name(self, name: str, form: Form) -> None:
        self.nodes[name] = Node(self.table.key("input", name), form, self.table.over(form))

    def _target(self, i: int) -> Form:
        target = self.claim.rows[i]["target"]
        if target == "reference":
            return {"r0": ONE}
        return {} if target == "zero" else self._kappa(target)

    def _kappa(self, i: int) -> Form:
        self._control(i)
        return plus({f"K{i}": ONE}, self.model[i])

    def _control(self, i: int) -> None:
        """θ̂_i in [0, ε(R+N)²/(2σ)], the gain in [½β, ½B], the modelling term."""
        if i in self.half:
            return
        gain, noise = self.gain[i], self._noise(i)
        peak = (self._error(i) + noise) ** 2
        theta = up(gain.epsilon[1] * peak / (2 * gain.sigma[0]))
        drive = max(gain.delta[1] * gain.sigma[1] * theta, gain.epsilon[1] * gain.delta[1] * peak / 2)
        self.theta[i], self.theta_rate[i] = theta, up(drive)
        self.half[i] = down(gain.beta[0] / 2), up((gain.beta[1] + gain.epsilon[1] * theta) / 2)
        self.table.definitions[f"K{i}"] = {f"Q{i}": neg(self.half[i])}
        self.table.ranges[f"K{i}"] = self.table.over(self.table.definitions[f"K{i}"])
        need(reads(self.term[i]) <= set(self.nodes), "a modelling term reads a state that comes later")
        self.model[i] = linear(self.term[i], self.nodes, self.table)[0].form

    def _error(self, i: int) -> Fraction:
        """Bound on |Q_i|."""
        return self.claim.half_widths[i]

    def _noise(self, i: int) -> Fraction:
        target, own = self.claim.rows[i]["target"], self.claim.noise[i]
        upstream = Fraction(0) if isinstance(target, str) else self._control_noise(target)
        self.noise[i] = own + upstream
        return self.noise[i]

    def _control_noise(self, i: int) -> Fraction:
        """What measurement errors make of κ_i."""
        shaken = {r["state"]: {"": symmetric(n)} for r, n in zip(self.claim.rows, self.claim.noise, strict=True)}
        direct = magnitude(derivative(self.term[i], self._ranges(), shaken).get("", ZERO))
        return up(self.half[i][1] * self.noise[i] + direct)

    def _ranges(self) -> dict[str, Interval]:
        ranges = {name: node.range for name, node in self.nodes.items()}
        for row, noise in zip(self.claim.rows, self.claim.noise, strict=True):
            if row["state"] in ranges:
                ranges[row["state"]] = add(ranges[row["state"]], symmetric(noise))
        return ranges

    def _rows(self) -> None:
        claim, table, n = self.claim, self.table, len(self.claim.rows)
        values = linear(claim.plant, self.nodes, table)
        self.mass = [value.range for value in values[:n]]
        if min(mass[0] for mass in self.mass) <= 0:
            raise NotProvedError("an inertia can vanish inside the assumptions")
        forces = [table.expand(value.form, keep="K") for value in values[n:]]
        moving = {r["state"]: times(f, inverse(m)) for r, f, m in zip(claim.rows, forces, self.mass, strict=True)}
        moving |= {f"r{k}": {f"r{k + 1}": ONE} for k in range(3)}
        moving |= {f"nominal.{name}": {"": rate} for name, (_, rate) in claim.feedforward.items()}
        self.open: list[Form] = []
        for i, row in enumerate(claim.rows):
            rate = {"r1": ONE} if row["target"] == "reference" else {}
            rate = self.virtual[row["target"]] if isinstance(row["target"], int) else rate
            self.open.append(plus(forces[i], times(rate, neg(self.mass[i]))))
            if i in self.gain:
                self.virtual[i] = self._virtual_rate(i, moving)
        self.closed = [table.expand(form) for form in self.open]
        rest = [{s: c for s, c in f.items() if s[:1] not in self.moving or not s} for f in self.closed]
        self.disturbance = [magnitude(table.over(form)) for form in rest]

    def _virtual_rate(self, i: int, moving: dict[str, Form]) -> Form:
        """κ_i' = -½(β + εθ̂) Q_i' - ½ε θ̂' Q_i + m_i'."""
        error_rate = times(self.open[i], inverse(self.mass[i]))
        adapting = symmetric(up(self.gain[i].epsilon[1] * self.theta_rate[i] / 2))
        term_rate = self.table.expand(derivative(self.term[i], self._ranges(), moving), keep="K")
        return plus(times(error_rate, neg(self.half[i])), {f"Q{i}": adapting}, term_rate)

    def entry(self, i: int, j: int) -> Interval:
        """S_ij."""
        return self.closed[i].get(f"Q{j}", ZERO)

    def own_gain(self, i: int) -> Fraction:
        """The smallest effect of the own virtual control."""
        return self.open[i].get(f"K{i}", ZERO)[0]

    def input_error(self, k: int) -> Fraction:
        """T_s sup|κ'| plus what noise adds: bounds |u_k - κ_k(t)| within a period."""
        row = self.claim.input_map[k]
        speed = magnitude(self.table.over(self.table.expand(self.virtual[row])))
        return self.claim.period * speed + self._control_noise(row)

    def signal(self, name: str) -> Fraction:
        """Bound on |input| as commanded, or on |state|."""
        if name not in self.claim.inputs:
            return magnitude(self.nodes[name].range)
        row = self.claim.input_map[self.claim.inputs.index(name)]
        return magnitude(self.table.over(self._kappa(row))) + self._beyond(row)

    def _beyond(self, row: int) -> Fraction:
        """What a commanded input may be more than its form says."""
        return self._control_noise(row)

    def adaptation_residual(self, i: int) -> Fraction:
        """What sampling and noise add to θ̂' in the Lyapunov function."""
        gain, period = self.gain[i], self.claim.period
        error = period * magnitude(self.table.over(self.closed[i])) / self.mass[i][0] + self.noise[i]
        squares = gain.epsilon[1] * gain.delta[1] * error * (2 * self.claim.half_widths[i] + error) / 2
        return up(gain.delta[1] * gain.sigma[1] * period * self.theta_rate[i] + squares)
