"""A simulated run at the control instants."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


@dataclass(frozen=True, kw_only=True)
class MemberTrace:
    """The signals of one member.

    Attributes:
        x: States. Shape (n, k).
        u: Inputs as commanded, held from each instant on. Shape (m, k).
        q: Errors as its law computes them. Shape (g, k).
        z: Discrete states of its law before each instant. Shape (d, k).
        r: Reference and three derivatives. Shape (4, k).
        outputs: Further plant signals by name. Each shape (k,).
    """

    x: Array
    u: Array
    q: Array
    z: Array
    r: Array
    outputs: Mapping[str, Array]

    @property
    def error(self) -> Array:
        """True error of the first state. Shape (k,)."""
        return self.x[0] - self.r[0]


@dataclass(frozen=True, kw_only=True)
class Trace:
    """A run.

    Attributes:
        t: Times, s. Shape (k,).
        members: By name.
        disturbances: By name. Each shape (k,).
        place: Output, m; of members that nothing joins their first states. Shape (d, k).
        wanted: Its reference. Shape (d, k).
        free: Whether nothing joins the members.
        diverged_s: Time at which the run was lost, s; infinite for a sound one. A lost run is shorter.
        body: States and further signals of the body that the members move, by name. Each shape (k,).
    """

    t: Array
    members: Mapping[str, MemberTrace]
    disturbances: Mapping[str, Array]
    place: Array
    wanted: Array
    free: bool
    diverged_s: float
    body: Mapping[str, Array] = field(default_factory=dict)

    @property
    def error(self) -> Array:
        """Distance of the output from its reference, m; with sign where the output is one coordinate. Shape (k,).

        Of members that nothing joins that of the worst one.
        """
        away = self.place - self.wanted
        return away[0] if len(away) == 1 else np.linalg.norm(away, ord=np.inf if self.free else 2, axis=0)
