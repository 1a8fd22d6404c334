"""Minimum-time references of machines of several joints, by the spline program."""

from __future__ import annotations

from collections.abc import Sequence

from trajectories import LimitViolatedError, Motion

from ..errors import InvalidInputError
from ..study import Study
from .job import Job, Move
from .mover import Bounded, Mover
from .sequence import carried_out


def least_time(
    study: Study, mover: Mover, places: Sequence[tuple[float, ...]], bounds: Bounded | None = None
) -> tuple[Motion, ...]:
    """Minimum-time moves with a weight on jerk between joint coordinates, at the largest payload.

    Args:
        study: The study.
        mover: Its machine.
        places: Joint coordinates, rad or m. Each shape (n,).
        bounds: Limits in place of the machine's.

    Raises:
        InvalidInputError: a move that cannot be reached.
    """
    section, payload = study.reference, max(study.uncertainty.disturbances["payload"].range)
    job = Job(
        mover=mover, start=places[0], longest=section.longest_s, bounds=bounds or Bounded(),
        moves=tuple(Move(joints=place, payload=payload) for place in places[1:]),
    )  # fmt: skip
    try:
        found = carried_out(
            job, lambda mass: mover.cost(payload=mass, jerk=section.jerk_weight), "reference", spans=section.spans
        )
    except LimitViolatedError as error:
        raise InvalidInputError(f"reference: {error}") from None
    return found.motions
