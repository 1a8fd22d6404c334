"""A plant: one symbolic model in strict-feedback form, with parameters and limits."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any, Literal

from stability.loops.model import BALANCE, CONSTANT

from .parameter import Parameter

#: Steps of Newton's method for what a mode carries.
NEWTON = 4


@dataclass(frozen=True, kw_only=True)
class Limit:
    """A bound on the Euclidean norm of some signals.

    Attributes:
        name: What is limited, for messages.
        signals: Names of plant inputs or states.
        value: Largest norm, [unit].
        unit: SI unit.
        source: Source tag of the value.
    """

    name: str
    signals: tuple[str, ...]
    value: float
    unit: str
    source: str


@dataclass(frozen=True, kw_only=True)
class Efforts:
    """What a motion asks of an actuator beside its speed, for the limits of a reference.

    Attributes:
        names: What each is.
        units: Their units.
        limits: The key of `reference.limits` that bounds each from above.
        of: (plant, disturbances) -> CasADi functions of the first state and its first three derivatives: the column of
            the efforts, and the power that an energy-optimal motion spends, W.
    """

    names: tuple[str, ...]
    units: tuple[str, ...]
    limits: tuple[str, ...]
    of: Callable[[Plant, Sequence[float]], tuple[Any, Any]]


@dataclass(frozen=True, kw_only=True)
class Plant:
    """A symbolic plant ``M_i x_i' = h_i(x, u, w, parameters)``, M_i > 0 constant in time.

    Attributes:
        name: Model name, as in a study.
        level: Input level, as in a study.
        states: Names of the states, in strict-feedback order. Shape (n,).
        state_units: Units of the states. Shape (n,).
        inputs: Names of the inputs. Shape (m,).
        input_unit: Unit of the inputs.
        disturbances: Names of the disturbances.
        parameters: Parameters by name.
        targets: For each state what it tracks: "reference", "zero", the index of the row whose virtual control is its
            target, or, where the law does not act, coefficients of r0, r1, r2 (reference, its rate, its acceleration),
            "constant" (1), "DISTURBANCE" and "DISTURBANCE/PARAMETER": their sum is the state's value in the motion
            that is asked for; or "balance", the value with which the only other row that reads it moves like that.
        controlled: For each state whether the law acts in its row. Shape (n,).
        input_map: For each input the row whose virtual control it is. Shape (m,).
        x, u, w, p: The symbols (CasADi SX columns) of states, inputs, disturbances and parameters.
        mass: M as a function of p. Shape (n,).
        force: h as a function of x, u, w, p. Shape (n,).
        limits: Limits on signals; the first is the amplitude limit of the input.
        stroke: Admissible range of the first state.
        outputs: Further signals for figures and reports, by name: expressions of x, u, w, p. "torque" is what the
            actuator delivers, "power" what it does mechanically, W.
        load_unit: Unit of the disturbances.
        output_units: Unit of each output.
        ratings: Numbers that the equations do not read: what a motion asks of the actuator follows from them.
        carried: Name of the parameter that holds the plant's own part of the inertia of bodies that a coupling moves;
            empty for a plant that cannot be a member of a coupling.
        first: Whether the first state is a position or a speed.
        efforts: What a motion asks of it; None where only speed, acceleration and jerk are limited.
        leads: Sections of lead that a law for it has in the row of an input: lags and modes that stand between.
        relief: How steeply a relief valve opens beyond the limit on a state, in h per unit of the state. It takes
            nothing where the limits hold, so that a proof, which keeps to them, is without it.
    """

    name: str
    level: str
    states: tuple[str, ...]
    state_units: tuple[str, ...]
    inputs: tuple[str, ...]
    input_unit: str
    disturbances: tuple[str, ...]
    parameters: Mapping[str, Parameter]
    targets: tuple[str | int | Mapping[str, float], ...]
    controlled: tuple[bool, ...]
    input_map: tuple[int, ...]
    x: Any
    u: Any
    w: Any
    p: Any
    mass: Any
    force: Any
    limits: tuple[Limit, ...]
    stroke: tuple[float, float]
    outputs: Mapping[str, Any]
    output_units: Mapping[str, str]
    load_unit: str = "N"
    carried: str = ""
    first: Literal["position", "speed"] = "position"
    efforts: Efforts | None = None
    ratings: Mapping[str, Parameter] = field(default_factory=dict)
    leads: int = 0
    relief: Mapping[str, float] = field(default_factory=dict)

    @property
    def modes(self) -> tuple[str, ...]:
        """States that no law acts in and that follow no row: nobody measures them."""
        pairs = zip(self.states, self.targets, strict=True)
        return tuple(state for state, target in pairs if isinstance(target, Mapping) or target == BALANCE)

    @property
    def operating(self) -> tuple[float, ...]:
        """State at which the time constants are read off: the middle of the stroke, half of each state's own limit."""
        own = {limit.signals[0]: limit.value / 2 for limit in self.limits if len(limit.signals) == 1}
        return (sum(self.stroke) / 2, *(own.get(state, 0.0) for state in self.states[1:]))

    @property
    def accelerating(self) -> int:
        """The row whose state's rate is the acceleration that a coupling moves."""
        return 1 if self.first == "position" else 0

    @property
    def reference_units(self) -> tuple[str, str, str, str]:
        """Units of the first state and its first three derivatives."""
        unit = self.state_units[0].removesuffix("/s")
        names = [unit, *(f"{unit}/s" if k == 1 else f"{unit}/s^{k}" for k in range(1, 5))]
        first = names.index(self.state_units[0])
        return (names[first], names[first + 1], names[first + 2], names[first + 3])

    def with_values(
        self, *, parameters: Mapping[str, Parameter] | None = None, limits: Mapping[str, Limit] | None = None,
        stroke: tuple[float, float] | None = None,
    ) -> Plant:  # fmt: skip
        """The same plant with other numbers in some places."""
        return replace(
            self, parameters={**self.parameters, **(parameters or {})},
            limits=tuple((limits or {}).get(limit.name, limit) for limit in self.limits),
            stroke=self.stroke if stroke is None else stroke,
        )  # fmt: skip

    @property
    def rate(self) -> Any:
        """X' = h / M as a CasADi expression. Shape (n,)."""
        return self.force / self.mass

    def values(self) -> dict[str, float]:
        """Nominal parameter values by name."""
        return {name: parameter.value for name, parameter in self.parameters.items()}

    def at(self, *, x: Any, u: Any, w: Any, p: Any) -> Any:
        """H with other expressions in place of the symbols. Shape (n,)."""
        import casadi as ca

        return ca.substitute([self.force], [self.x, self.u, self.w, self.p], [x, u, w, p])[0]

    def _driver(self, i: int) -> tuple[Any, list[int]]:
        """What drives a row: the state that tracks its virtual control, or its input; and the rows that follow it."""
        following = [j for j, target in enumerate(self.targets) if target == i]
        return (self.x[following[0]] if following else self.u[self.input_map.index(i)]), following

    def _driven(self, i: int) -> int:
        """The row that this acts in: row i, or where that does not read it, the only other one that does."""
        import casadi as ca

        source, following = self._driver(i)
        reading = [j for j in range(len(self.states)) if j not in following and ca.depends_on(self.force[j], source)]
        return i if i in reading or len(reading) != 1 else reading[0]

    def standing(self, loads: Sequence[float]) -> list[float]:
        """The state in the middle of the stroke that is asked for at standstill, at nominal parameters."""
        import casadi as ca

        values = self.values()
        acting = {CONSTANT: 1.0, **dict(zip(self.disturbances, loads, strict=True))}
        acting |= {f"{load}/{name}": acting[load] / v for load in self.disturbances for name, v in values.items() if v}
        place = sum(self.stroke) / 2 if self.first == "position" else 0.0
        held = [target if isinstance(target, Mapping) else {} for target in self.targets[1:]]
        found = [place, *(sum(share * acting.get(name, 0.0) for name, share in own.items()) for own in held)]
        for i, target in enumerate(self.targets):
            if target == BALANCE:
                r = [place, 0.0, 0.0, 0.0]
                found[i] = float(ca.evalf(self.balanced(i, ca.DM(r), ca.DM(list(loads)), ca.DM(list(values.values())))))
        return found

    @property
    def measured(self) -> list[int]:
        """Rows whose states a law measures: the first one, and those that it acts in."""
        return [k for k, acts in enumerate(self.controlled) if acts or k == 0]

    def feels(self, state: str) -> bool:
        """Whether a state feels a disturbance while all that is measured is held, by itself or by way of others."""
        import casadi as ca

        known = self.measured
        reached, fresh = set(known), [k for k in [self.states.index(state)] if k not in known]
        while fresh:
            i = fresh.pop()
            reached.add(i)
            if ca.depends_on(self.force[i], self.w):
                return True
            fresh += [
                j for j in range(len(self.states)) if j not in reached and ca.depends_on(self.force[i], self.x[j])
            ]
        return False

    def readers(self, i: int) -> list[int]:
        """The other rows that read the state of row i."""
        import casadi as ca

        return [j for j in range(len(self.states)) if j != i and ca.depends_on(self.force[j], self.x[i])]

    def balanced(self, i: int, r: Any, w: Any, p: Any) -> Any:
        """The state of row i with which the only other row that reads it moves as is asked for, as an expression.

        Args:
            i: Row.
            r: Reference and its first three derivatives. Shape (4,).
            w: Disturbances.
            p: Parameters.

        A few steps of Newton's method: exact where the row is linear in the state on either side of zero.
        """
        import casadi as ca

        k = self.readers(i)[0]
        missing = self.force[k] - self.mass[k] * (r[1] if k == 0 else 0)
        x = ca.vertcat(*(r[0] if j == 0 else 0 for j in range(len(self.states))))
        step = -missing / ca.jacobian(missing, self.x[i])
        for _ in range(NEWTON):
            more = ca.substitute([step], [self.x, self.u, self.w, self.p], [x, ca.SX.zeros(self.u.numel()), w, p])[0]
            x = ca.vertcat(*(x[j] + (more if j == i else 0) for j in range(len(self.states))))
        return x[i]

    def inertia_over_gain(self, i: int) -> float:
        """M_i over the effect of what drives row i, at nominal parameters, at rest in the middle of the stroke.

        Where that acts in another row, what stands between both moves with it: it is that row's.
        """
        import casadi as ca

        row = self._driven(i)
        gain = ca.jacobian(self.force[row], self._driver(i)[0])
        point = [
            list(self.operating),
            [0.0] * len(self.inputs),
            [0.0] * len(self.disturbances),
            list(self.values().values()),
        ]
        found = ca.Function("ratio", [self.x, self.u, self.w, self.p], [self.mass[row], gain])(*point)
        mass, effect = (abs(float(value)) for value in found)
        return mass / effect if effect > 0 else mass

    def demand(self, i: int, rate: Any, *, x: Any, w: Any, p: Any) -> Any:
        """The value of what drives a row that gives ``x_i' = rate``, where h_i is affine in it.

        A row is driven by the state that tracks its virtual control, or where there is none by its input; where that
        acts in another row, it is that row's rate.

        Args:
            i: Row.
            rate: Wanted x_i'.
            x: The other states. Shape (n,).
            w: Disturbances.
            p: Parameters.
        """
        import casadi as ca

        (source, following), row = self._driver(i), self._driven(i)
        without = ca.vertcat(*(0 if j in following[:1] else x[j] for j in range(len(self.states))))
        symbols, values = [self.x, self.u, self.w, self.p], [without, ca.SX.zeros(len(self.inputs)), w, p]
        gain = ca.jacobian(self.force[row], source)
        mass, force, gain = ca.substitute([self.mass[row], self.force[row], gain], symbols, values)
        return (mass * rate - force) / gain
