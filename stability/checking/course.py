"""The reference of a file is the study's: its places, pauses, durations and limits.

Theorem: as `reference`. Must fail: another waypoint, another duration, a move beyond a limit, a last
segment that is not the study's.
"""

from __future__ import annotations

from fractions import Fraction
from itertools import pairwise
from typing import Any

from .arithmetic import Interval
from .claim import Claim
from .limits import FLOOR, MET, need
from .parsing import number, numbers
from .reference import ranges_on


def follows(data: dict[str, Any], entry: dict[str, Any], claim: Claim, which: int) -> None:
    """Refuse a reference that is not the study's.

    Args:
        data: The file.
        entry: The entry of a member.
        claim: The statement about it.
        which: Its place among the members.
    """
    section = data["study"]["reference"]
    count = len(data["members"])
    places = [numbers(place, count, "a waypoint")[which] for place in section["waypoints"]]
    pause, pace = number(section["dwell_s"], "dwell_s"), number(section["pace"], "pace")
    need(0 < pace <= 1 and pause >= 0, "the pace must be in (0, 1], a pause not negative")
    segments = entry["reference"]["segments"]
    moves = segments[1::2] if pause > 0 else segments
    still = segments[::2] if pause > 0 else []
    need(len(moves) == len(places) - 1, f"the reference must make {len(places) - 1} moves: got {len(moves)}")
    need(not pause or len(still) == len(places), "the reference must rest before, between and after its moves")
    for segment, place in zip(still, places, strict=False):
        knots, points = _of(segment)
        need(_close(knots[-1] - knots[0], pause), f"the reference must rest for {float(pause):g} s")
        need(len(set(points)) == 1 and _close(points[0], place), f"the reference must rest at {float(place):g}")
    durations = section["durations_s"]
    timed = section["kind"] == "quintic" or section["objective"] == "energy"
    need(len(durations) == (len(moves) if timed else 0), "the study does not give the durations of the moves")
    for k, segment in enumerate(moves):
        knots, points = _of(segment)
        need(_close(points[0], places[k]) and _close(points[-1], places[k + 1]), f"move {k + 1} misses its waypoints")
        at_rest = points[0] == points[1] == points[2] and points[-1] == points[-2] == points[-3]
        need(at_rest, f"move {k + 1} is not from rest to rest")
        need(section["kind"] != "quintic" or _quintic(knots, points), f"move {k + 1} is not a quintic")
        lasted = (knots[-1] - knots[0]) * pace
        if timed:
            need(
                _close(lasted, number(durations[k], "a duration")), f"move {k + 1} lasts another time than the study's"
            )
        else:
            need(lasted <= number(section["longest_s"], "longest_s") * (1 + MET), f"move {k + 1} lasts too long")
    lasted = number(segments[-1]["knots"][-1], "a knot")
    need(claim.transient < lasted, "the transient outlasts the reference")
    _limited(section, claim, segments, which, count if data["couplings"] else 1)


def _of(segment: dict[str, Any]) -> tuple[list[Fraction], list[Fraction]]:
    count = len(segment["coefficients"])
    return numbers(segment["knots"], count + 6, "knots"), numbers(segment["coefficients"], count, "coefficients")


def _close(value: Fraction, wanted: Fraction) -> bool:
    return abs(value - wanted) <= MET * abs(wanted) + FLOOR


def _quintic(knots: list[Fraction], points: list[Fraction]) -> bool:
    """Whether the control points are those of 10 s³ - 15 s⁴ + 6 s⁵: its symmetric multi-affine form at the knots."""
    begin, lasted, way = knots[0], knots[-1] - knots[0], points[-1] - points[0]
    for k, point in enumerate(points):
        sums = [Fraction(1), *[Fraction(0)] * 5]  # elementary symmetric polynomials of five knots
        for knot in knots[k + 1 : k + 6]:
            share = (knot - begin) / lasted
            sums = [sums[0], *(now + share * before for before, now in pairwise(sums))]
        if abs(points[0] + way * (sums[3] - 3 * sums[4] + 6 * sums[5]) - point) > MET * abs(way):
            return False
    return True


def _limited(section: dict[str, Any], claim: Claim, segments: list[dict[str, Any]], which: int, count: int) -> None:
    """The study's limits on speed, acceleration and jerk: by control points, or where these pass them by spans."""
    given = section.get("limits")
    if given is None:
        return
    first = 1 if claim.first == "position" else 0
    single = {"speed_m_s": first, "acceleration_m_s2": first + 1, "jerk_m_s3": first + 2}
    each = {"speed": 1, "acceleration": 2, "jerk": 3}
    wrong = sorted(set(given) & set(each if count == 1 else single))
    need(not wrong, f"reference.limits.{'; '.join(wrong)} has no place in this machine")
    need(count == 1 or claim.first == "position", "the limits of several members are those of positions")
    for key, order in (single if count == 1 else each).items():
        if key not in given:
            need(count > 1, f"reference.limits.{key} is missing")
            continue
        limit = number(given[key], key) if count == 1 else numbers(given[key], count, key)[which]
        need(limit > 0, f"{key} must be positive")
        if not _inside(claim.reference[order], limit):
            kept = all(_inside(piece[order], limit) for segment in segments for piece in _pieces(segment))
            need(kept, f"the reference passes reference.limits.{key}")


def _inside(found: Interval, limit: Fraction) -> bool:
    return max(-found[0], found[1]) <= limit * (1 + MET)


def _pieces(segment: dict[str, Any]) -> list[list[Interval]]:
    knots, points = _of(segment)
    spans = [k for k in range(5, len(knots) - 6) if knots[k] < knots[k + 1]]
    return [ranges_on(knots, points, k, (knots[k], knots[k + 1])) for k in spans]
