"""Scenarios: what load, parameters and noise a simulated run meets."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from ..study import Study

Array = NDArray[np.float64]


@dataclass(frozen=True, kw_only=True)
class Fault:
    """An actuator that loses effectiveness from a time on; see `ClosedLoop.system`.

    Attributes:
        share: Lost share of the input in the end, 0 … 1; 1 is stuck.
        start_s: Time at which it begins, s.
        rate_1_s: How fast it grows, 1/s.
        stuck: What the lost share delivers instead, in the unit of the inputs; zero where shorter than the inputs.
    """

    share: float
    start_s: float
    rate_1_s: float
    stuck: tuple[float, ...] = ()


@dataclass(frozen=True, kw_only=True)
class Scenario:
    """One run.

    Attributes:
        name: Name for reports.
        load: Breakpoints (time in s, load in N), linear between them, constant outside.
        parameters: Position of plant parameters in their tolerance, -1 … 1; nominal where not named.
        noise: Share of the assumed measurement error, uniformly distributed, 0 … 1.
        bias: Share of the assumed measurement error that is constant, -1 … 1; the random part has the rest.
        initial: Position of the first error in its assumed range, -1 … 1.
        quantisation: Share of the assumed measurement error that is the rounding of an encoder, 0 … 1.
        fault: What goes wrong with the actuator; outside the assumptions of a proof.
        seed: Seed of the noise.
    """

    name: str
    load: tuple[tuple[float, float], ...]
    parameters: Mapping[str, float] = field(default_factory=dict)
    noise: float = 0.0
    bias: float = 0.0
    initial: float = 0.0
    quantisation: float = 0.0
    fault: Fault | None = None
    seed: int = 0

    @property
    def covered(self) -> bool:
        """Inside the assumptions that a proof is made under."""
        return self.fault is None

    def load_at(self, t: Array) -> Array:
        """The load at given times, N. Shape of t."""
        times, values = zip(*self.load, strict=True)
        return np.interp(t, times, values)

    def fault_column(self, inputs: int) -> Array:
        """Share, start, rate, and what a stuck actuator delivers. Shape (3 + inputs,)."""
        return fault_column(self.fault, inputs)


def fault_column(fault: Fault | None, inputs: int) -> Array:
    """Share, start, rate, and what a stuck actuator delivers; zeros for none. Shape (3 + inputs,)."""
    fault = fault or Fault(share=0.0, start_s=0.0, rate_1_s=0.0)
    stuck = (*fault.stuck, *[0.0] * (inputs - len(fault.stuck)))
    return np.array([fault.share, fault.start_s, fault.rate_1_s, *stuck])


def scenarios(study: Study) -> list[Scenario]:
    """The scenarios of a study."""
    return [
        Scenario(
            name=s.name, load=s.load_n, parameters=s.parameters, noise=s.noise, bias=s.bias, initial=s.initial,
            quantisation=s.quantisation,
            fault=None if s.fault is None else Fault(**s.fault.model_dump()),
            seed=study.tuning.seed + k,
        )
        for k, s in enumerate(study.validation.scenarios)
    ]  # fmt: skip
