"""Rivals by name: every file of this folder with a `RIVAL`, a class of a plant and its modelling terms."""

from __future__ import annotations

from ...discovery import all_offered
from .rival import Rival


def rivals() -> dict[str, type[Rival]]:
    """All rivals by the name that they give themselves."""
    return {kind.NAME: kind for kind in all_offered(f"{__package__}", "RIVAL").values()}
