"""How long a search may go on."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, kw_only=True)
class Budget:
    """When a search ends: at whichever comes first.

    Attributes:
        evaluations: Candidates that may be evaluated, the first population included; at least one iteration's.
        seconds: Wall-clock time. A search that it ends is not reproducible.
    """

    evaluations: int
    seconds: float = float("inf")
