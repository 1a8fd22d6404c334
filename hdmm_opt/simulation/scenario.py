"""Scenarios: what load, parameters and noise a simulated run meets."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from ..study import Study

Array = NDArray[np.float64]


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
        seed: Seed of the noise.
    """

    name: str
    load: tuple[tuple[float, float], ...]
    parameters: Mapping[str, float] = field(default_factory=dict)
    noise: float = 0.0
    bias: float = 0.0
    initial: float = 0.0
    seed: int = 0

    def load_at(self, t: Array) -> Array:
        """The load at given times, N. Shape of t."""
        times, values = zip(*self.load, strict=True)
        return np.interp(t, times, values)

    def noise_at(self, count: int, bounds: Array) -> Array:
        """Measurement errors. Shape (n, count)."""
        draws = np.random.default_rng(self.seed).uniform(-1.0, 1.0, (bounds.size, count))
        return bounds[:, None] * (self.bias + self.noise * (1 - abs(self.bias)) * draws)


def scenarios(study: Study) -> list[Scenario]:
    """The scenarios of a study."""
    return [
        Scenario(
            name=s.name, load=s.load_n, parameters=s.parameters, noise=s.noise, bias=s.bias,
            initial=s.initial,
            seed=study.tuning.seed + k,
        )
        for k, s in enumerate(study.validation.scenarios)
    ]  # fmt: skip
