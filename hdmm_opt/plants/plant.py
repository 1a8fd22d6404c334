"""A plant: one symbolic model in strict-feedback form, with parameters and limits."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from .parameter import Parameter


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
        targets: For each state what it tracks: "reference", "zero", or the index of the row whose virtual control
            is its target.
        governed: For each state whether the law acts in its row. Shape (n,).
        drives: For each input the row whose virtual control it is. Shape (m,).
        x, u, w, p: The symbols (CasADi SX columns) of states, inputs, disturbances and parameters.
        mass: M as a function of p. Shape (n,).
        force: h as a function of x, u, w, p. Shape (n,).
        limits: Limits on signals; the first is the amplitude limit of the input.
        stroke: Admissible range of the first state.
        outputs: Further signals for reports, by name: expressions of x, u, w, p.
        load_unit: Unit of the disturbances.
    """

    name: str
    level: str
    states: tuple[str, ...]
    state_units: tuple[str, ...]
    inputs: tuple[str, ...]
    input_unit: str
    disturbances: tuple[str, ...]
    parameters: Mapping[str, Parameter]
    targets: tuple[str | int, ...]
    governed: tuple[bool, ...]
    drives: tuple[int, ...]
    x: Any
    u: Any
    w: Any
    p: Any
    mass: Any
    force: Any
    limits: tuple[Limit, ...]
    stroke: tuple[float, float]
    outputs: Mapping[str, Any]
    load_unit: str = "N"

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

    def demand(self, i: int, rate: Any, *, x: Any, w: Any, p: Any) -> Any:
        """The value of state i + 1 that gives ``x_i' = rate``, where h_i is affine in it.

        Args:
            i: Row.
            rate: Wanted x_i'.
            x: The other states. Shape (n,).
            w: Disturbances.
            p: Parameters.
        """
        import casadi as ca

        without = ca.vertcat(*(0 if j == i + 1 else x[j] for j in range(len(self.states))))
        symbols, values = [self.x, self.u, self.w, self.p], [without, ca.SX.zeros(len(self.inputs)), w, p]
        gain = ca.jacobian(self.force[i], self.x[i + 1])
        mass, force, gain = ca.substitute([self.mass[i], self.force[i], gain], symbols, values)
        return (mass * rate - force) / gain
