"""A machine as sticks that move along a run and along its reference, for the report."""

from __future__ import annotations

from typing import Any

import numpy as np

from ..problem import Problem
from ..simulation import Trace

#: Frames of an animation, and its width in the units of the drawing.
FRAMES, WIDTH = 150, 600.0


def frames(problem: Problem, trace: Trace) -> dict[str, Any] | None:
    """Times, and the points of the machine and of its reference in every frame; None for a machine without sticks.

    Points are in the plane in which they move most, in the units of a drawing of that width.
    """
    if problem.machine.sticks is None:
        return None
    pick = np.linspace(0, trace.t.size - 1, min(FRAMES, trace.t.size)).astype(int)
    real, wanted = (
        np.array([
            np.array(problem.machine.sticks([own(trace.members[m.name])[k] for m in problem.members])) for k in pick
        ])
        for own in (lambda member: member.x[0], lambda member: member.r[0])
    )  # fmt: skip
    spread = (np.ptp(real, axis=0).max(axis=1) + np.ptp(real[0], axis=1)) * np.array([1.0, 0.999, 1.001])
    plane = sorted(np.argsort(spread)[-2:])
    real, wanted = real[:, plane, :], wanted[:, plane, :]
    low = np.minimum(real.min(axis=(0, 2)), wanted.min(axis=(0, 2)))
    high = np.maximum(real.max(axis=(0, 2)), wanted.max(axis=(0, 2)))
    scale = WIDTH / max(float(high[0] - low[0]), 1e-9)
    height = scale * float(high[1] - low[1])

    def drawn(points: Any) -> list[list[list[float]]]:
        across, up = scale * (points[:, 0] - low[0]), height - scale * (points[:, 1] - low[1])
        return [[[round(float(a), 1), round(float(b), 1)] for a, b in zip(*pair, strict=True)]
                for pair in zip(across, up, strict=True)]  # fmt: skip

    return {
        "t": [round(float(v), 3) for v in trace.t[pick]], "real": drawn(real), "wanted": drawn(wanted),
        "width": WIDTH, "height": round(max(height, 40.0), 1), "axes": "xyz"[plane[0]] + "xyz"[plane[1]],
    }  # fmt: skip
