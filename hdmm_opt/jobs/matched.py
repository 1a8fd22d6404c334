"""Disturbances that add up: courses matched to what a loop makes of a step of each.

The response h of a linear loop is worst met by sign h(T - t), and a course of bounded rate by one whose slope has the
sign of the step response at T - t: both reach the L1 norms of a proof in a loop that is linear and nominal.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import partial

import numpy as np
from numpy.typing import NDArray

from stability import Interval

from ..problem import GainSet
from ..simulation import Loop, Scenario
from ..simulation.scenario import Course, slowed

Array = NDArray[np.float64]

#: Share of a disturbance's range that a step is of; what is met is as long as this, s; shortest time of a change, s.
STEP, LENGTH, SHORTEST = 0.1, 1.5, 1e-4


def matched(loop: Loop, gains: GainSet, names: Sequence[str]) -> list[dict[str, Course]]:
    """Courses of all disturbances together that push the error to either side, early and late in the motion.

    Args:
        loop: The loop.
        gains: Gains to attack.
        names: Disturbances of any course.

    Returns:
        None of them where the output is of several coordinates, or where a run is lost.

    Not guaranteed: that a loop which is not linear has no worse ones.
    """
    problem = loop.problem
    begin = problem.study.validation.transient_s
    if problem.duration - begin < LENGTH or not names:
        return []
    spans = {name: problem.disturbance(name) for name in names}
    still = {name: ((0.0, (s.low + s.high) / 2),) for name, s in spans.items()}
    run = partial(_error, loop, gains)
    rest = run(still)
    found: dict[str, Array] = {}
    for name, span in spans.items():
        middle, more = still[name][0][1], STEP * (span.high - span.low)
        step: Course = ((0.0, middle), (begin, middle), (begin + SHORTEST, middle + more))
        rate = problem.rate_of(name)
        moved = run({**still, name: step if rate is None else slowed(step, rate)})
        if moved is None or rest is None or len(moved) != len(rest):
            return []
        found[name] = (moved - rest)[round(begin / loop.period) :][: round(LENGTH / loop.period)]
    ends = (begin + LENGTH, problem.duration)
    return [
        {name: _course(found[name], spans[name], problem.rate_of(name), end, sign, loop.period) for name in names}
        for end in ends for sign in (1.0, -1.0)
    ]  # fmt: skip


def _error(loop: Loop, gains: GainSet, courses: Mapping[str, Course]) -> Array | None:
    """The error of a quiet run, with its sign; None where it is lost or not one coordinate."""
    trace = loop.trace(gains, Scenario(name="step", disturbances=courses))
    return trace.error if len(trace.place) == 1 and np.isinf(trace.diverged_s) else None


def _course(step: Array, span: Interval, rate: float | None, end: float, sign: float, period: float) -> Course:
    """The course that is worst at a time for a step response, without the points that lie between others."""
    low, high = span.low, span.high
    middle, swing = (low + high) / 2, (high - low) / 2
    times = end - period * np.arange(len(step))[::-1]
    if rate is None:
        values = middle + sign * swing * np.sign(np.diff(step, prepend=0.0))[::-1]
    else:
        slopes = sign * rate * np.sign(step)[::-1] * period
        values, now = np.empty(len(slopes)), middle
        for k, slope in enumerate(slopes):
            now = min(max(now + slope, low), high)
            values[k] = now
    bent = np.abs(np.diff(values, 2)) > 1e-9 * swing
    kept = np.concatenate([[True], bent, [True]])
    return ((0.0, float(values[0])), *zip(times[kept].tolist(), values[kept].tolist(), strict=True))
