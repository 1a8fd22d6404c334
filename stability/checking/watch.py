"""What shuts a machine down does not act while the assumptions hold: on errors, inputs and first states.

Theorem: a measured error is at most the certified one and the sensor's; an input and a measured state are inside
their certified ranges. Of what a monitor estimates nothing is decided. Must fail: a monitor with less room than that.
"""

from __future__ import annotations

from fractions import Fraction
from typing import Any

from .arithmetic import symmetric
from .limits import need
from .member import Member
from .obligation import Obligation, decided, upward
from .parsing import number, numbers


def quiet(data: dict[str, Any], members: list[Member]) -> list[Obligation]:
    """Decide that the monitor of a study never acts inside the assumptions, as far as it measures what it watches."""
    monitor = data["study"]["controller"].get("monitor")
    return [] if monitor is None else [_quiet(monitor, member) for member in members]


def _quiet(monitor: dict[str, Any], member: Member) -> Obligation:
    claim = member.claim
    error = number(monitor["error"], "the monitored error")
    unit = str(claim.rows[0]["unit"])
    met = claim.half_widths[0] + claim.measured[0]
    least, told = 1 - met / error, [f"an error of {upward(met)} of {upward(error)} {unit}"]
    estimated, unmeasured = [], [row["state"] for k, row in enumerate(claim.rows) if k and not row["controlled"]]
    wrong = {row["state"]: size for row, size in zip(claim.rows, claim.measured, strict=True)}
    limits = {limit["name"]: limit for limit in claim.limits}
    for name, span in monitor["limits"].items():
        need(name in limits and len(limits[name]["signals"]) == 1, f"{name} is no limit on one signal of {claim.name}")
        low, high = numbers(span, 2, name)
        need(low < high, f"the monitored range of {name} is upside down")
        (signal,) = limits[name]["signals"]
        if signal in unmeasured:
            estimated.append(name)
            continue
        found = symmetric(member.verdict.norm([signal]) + wrong.get(signal, Fraction(0)))
        least = min(least, 2 * min(found[0] - low, high - found[1]) / (high - low))
        told.append(f"{name} within {upward(found[1])}")
    rest = f"; of {', '.join(estimated)}, which it estimates, nothing is decided" if estimated else ""
    statement = f"inside the assumptions the monitor does not act: it sees at most {', '.join(told)}{rest}"
    remedy = f"wider ranges of the monitor, an error of {upward(met)} {unit} among them"
    return decided("monitor", statement, Fraction(least), "1", remedy, member=claim.name)
