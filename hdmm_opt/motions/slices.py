"""Ranges of all references over slices of time."""

from __future__ import annotations

import numpy as np

from stability.networks.coupling import Slices
from trajectories import Reference, Spline, pieces

#: How often each piece of the reference is halved into slices of time.
HALVINGS = 1


def sliced(references: tuple[Reference, ...]) -> Slices:
    """The pieces between knots, halved; references of the same knots."""
    parts: Slices | None = None
    for segments in zip(*(reference.segments for reference in references), strict=True):
        together = Spline(knots=segments[0].knots, coefficients=np.stack([s.coefficients for s in segments], axis=1))
        found = pieces(together)
        still_here = len(found.start) == 1
        for _ in range(0 if still_here else HALVINGS):
            found = found.halved()
        low, high = found.ranges()
        part = Slices(low=low[:4], high=high[:4])
        parts = part if parts is None else parts.merged(part)
    assert parts is not None
    return parts
