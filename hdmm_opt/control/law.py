"""What every control law is: gains with names and ranges, discrete states, and one control period as expressions.

A law is written once. The simulation composes `step` with the plant, and where the law can be
proved `loop_model` hands plant and law to the prover as data.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Protocol

from stability import Gains, LoopModel

from ..plants import Plant


@dataclass(frozen=True, kw_only=True)
class GainSpec:
    """One gain of a law.

    Attributes:
        name: Name in a study, for example "beta_1".
        unit: SI unit.
        meaning: One line.
        default: Value where a study leaves it out; None where it must not.
        zero: Whether it may be zero.
        signed: Whether it may be negative too.
        low, high: Range in which a law without a study's range is searched; None where a study gives it.
    """

    name: str
    unit: str
    meaning: str
    default: float | None = None
    zero: bool = False
    signed: bool = False
    low: float | None = None
    high: float | None = None


class Law(Protocol):
    """A law for one plant."""

    @property
    def plant(self) -> Plant:
        """The plant."""
        ...

    @property
    def schema(self) -> tuple[GainSpec, ...]:
        """The gains, in the order of every vector of gains."""
        ...

    @property
    def states(self) -> int:
        """Number of discrete states; all start at zero but what `start` says."""
        ...

    def start(self, x: Sequence[float], gains: Sequence[float]) -> list[float]:
        """Discrete states for a first measurement and gains. Shape (states,)."""
        ...

    def step(self, x: Any, r: Any, z: Any, gains: Any, nominal: Any, load: Any, period: float) -> Any:
        """One control period.

        Args:
            x: Measured states. Shape (n,).
            r: Reference and its first three derivatives. Shape (4,).
            z: Discrete states. Shape (states,).
            gains: In the order of `schema`.
            nominal: Nominal parameters. Shape of plant.p.
            load: Nominal or foreseen disturbances. Shape of plant.w.
            period: Control period, s.

        Returns:
            Inputs inside the amplitude limit, shape (m,); discrete states after the period; errors, shape (g,).
        """
        ...


class ProvableLaw(Law, Protocol):
    """A law that the prover knows."""

    @property
    def controlled(self) -> tuple[int, ...]:
        """Indices of the rows that carry gains."""
        ...

    def loop_model(self) -> LoopModel:
        """Plant and law as data."""
        ...

    def derived(self, rate: float, initial: Sequence[float]) -> dict[str, tuple[float, float]]:
        """Ranges of gains that have no default and that a study leaves out: control rate in Hz, initial errors."""
        ...

    def rows_of(self, values: Sequence[float]) -> tuple[Gains, ...]:
        """A vector of gains as the prover takes them, one for each controlled row."""
        ...


def limited(plant: Plant, u: Any) -> Any:
    """The input scaled to the norm that the plant's amplitude limit allows."""
    import casadi as ca

    norm, largest = ca.fabs(u) if u.numel() == 1 else ca.norm_2(u), plant.limits[0].value
    return u * (largest / ca.fmax(norm, largest))


def named(schema: Sequence[GainSpec], values: Sequence[float]) -> Mapping[str, float]:
    """Gains by name."""
    return {spec.name: value for spec, value in zip(schema, values, strict=True)}


def step_function(law: Law, period: float) -> Any:
    """`step` as a CasADi function (x, r, z, gains, nominal, load) -> (u, z_next, errors)."""
    import casadi as ca

    plant = law.plant
    sizes = {"x": len(plant.states), "r": 4, "z": law.states, "gains": len(law.schema), "nominal": plant.p.numel(),
             "load": plant.w.numel()}  # fmt: skip
    symbols = {name: ca.SX.sym(name, size) for name, size in sizes.items()}
    return ca.Function(
        "step", list(symbols.values()), [*law.step(**symbols, period=period)], list(sizes), ["u", "z_next", "errors"]
    )
