"""What a run did, from what the engine accumulated."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from .layout import Part
from .records import Settings


@dataclass(frozen=True, kw_only=True)
class MemberFigures:
    """What a run did to one member.

    Attributes:
        largest_error: Largest |error| at any time, between the control instants too, in the unit of its first state.
        maximum_error: The same after the transient.
        rms_error: RMS error after the transient.
        limit_use: Largest share of a limit that it used; 1 where an input saturated.
        peak_input: Largest norm of its commanded input.
        travel: Total variation of its commanded input, from zero.
        peaks: Largest size of each output, such as "torque" and "current".
        rms: RMS of each over the run.
        energy_j: Mechanical energy that it delivered, with sign.
        estimates: Largest error of its observer in position and in speed; empty where there is none.
    """

    largest_error: float
    maximum_error: float
    rms_error: float
    limit_use: float
    peak_input: float
    travel: float
    peaks: Mapping[str, float]
    rms: Mapping[str, float]
    energy_j: float
    estimates: tuple[float, ...]


@dataclass(frozen=True, kw_only=True)
class Figures:
    """What a run did.

    Attributes:
        maximum_error_m: Largest distance of the output from its reference after the transient, between the control
            instants too; infinite for a run that was lost.
        largest_error_m: The same at any time.
        rms_error_m: RMS of that distance after the transient.
        settling_time_s: First time after which the output stays inside the required band.
        itae: Integral of time times that distance, m s².
        limit_use: Largest share of a limit that any member used.
        diverged_s: Time at which the run was lost, s; infinite for a sound one. A run is lost where a value is not
            finite or a member is further than half a metre or radian from its reference.
        members: By name.
        met_use: Largest share of an assumed range or rate that the loads of a body took: beyond 1 a run is outside the
            assumptions; None where all disturbances had courses.
        spread: Largest difference between the errors of two members after the transient, for members that are to move
            together and that nothing joins; None for others.
        stopped_s: Time from which a monitor kept the actuators shut down, s; infinite where it did not act, None
            without one. Error figures of a run that was shut down say how far the motion that was asked for went on.
    """

    maximum_error_m: float
    largest_error_m: float
    rms_error_m: float
    settling_time_s: float
    itae: float
    limit_use: float
    diverged_s: float
    members: Mapping[str, MemberFigures]
    met_use: float | None = None
    spread: float | None = None
    stopped_s: float | None = None

    @property
    def diverged(self) -> bool:
        """The run ended early."""
        return math.isfinite(self.diverged_s)

    def to_data(self) -> dict[str, Any]:
        """Figures as JSON data; what is not finite, in a run that was lost, is null."""
        data = plain(asdict(self))
        given = {"met_use": self.met_use, "spread": self.spread, "stopped_s": self.stopped_s}
        return {key: value for key, value in data.items() if key not in given or given[key] is not None}


def plain(value: Any) -> Any:
    """JSON data with null for what is not finite."""
    if isinstance(value, Mapping):
        return {key: plain(part) for key, part in value.items()}
    if isinstance(value, tuple | list):
        return [plain(part) for part in value]
    return value if not isinstance(value, float) or math.isfinite(value) else None


def figures(
    found: Mapping[str, float], lost: float, parts: Sequence[Part], settings: Settings, period: float, count: int
) -> Figures:
    """Figures from what a run accumulated.

    Args:
        found: Record name -> value.
        lost: Time at which the run was lost, s.
        parts: The members in the loop.
        settings: What the records were made with.
        period: Duration of a tick, s.
        count: Ticks of the run.

    Returns:
        The figures; infinite errors for a lost run, whose other figures end where it was lost.
    """
    gone = math.isfinite(lost)
    ticks = min(count, max(1, round(lost / period))) if gone else count
    late = int(np.count_nonzero(period * np.arange(ticks) >= settings.transient)) or 1
    members = {part.name: _member(part, found, gone, ticks, late, period) for part in parts}
    settled = ticks * period if gone else found["outside"] + period if found["ever outside"] else 0.0
    return Figures(
        maximum_error_m=math.inf if gone else found["late"],
        largest_error_m=math.inf if gone else found["error"],
        rms_error_m=math.inf if gone else math.sqrt(found["squares"] / late),
        settling_time_s=settled,
        itae=math.inf if gone else found["itae"] * period,
        limit_use=max(m.limit_use for m in members.values()),
        diverged_s=lost,
        members=members,
        met_use=found.get("met use"),
        spread=found.get("spread"),
        stopped_s=_stopped(found, count, period),
    )


def _stopped(found: Mapping[str, float], count: int, period: float) -> float | None:
    if "running" not in found:
        return None
    return found["running"] * period if found["running"] < count else math.inf


def _member(part: Part, found: Mapping[str, float], gone: bool, ticks: int, late: int, period: float) -> MemberFigures:
    name, outputs = part.name, [key for key in part.law.plant.outputs if key != "power"]
    watched = [found[f"estimated {what} {name}"] for what in ("position", "speed")] if part.observer else []
    return MemberFigures(
        largest_error=math.inf if gone else found[f"error {name}"],
        maximum_error=math.inf if gone else found[f"late {name}"],
        rms_error=math.inf if gone else math.sqrt(found[f"squares {name}"] / late),
        limit_use=found[f"use {name}"],
        peak_input=found[f"input {name}"],
        travel=found[f"travel {name}"],
        peaks={key: found[f"peak {key} {name}"] for key in outputs},
        rms={key: math.sqrt(found[f"squares {key} {name}"] / ticks) for key in outputs},
        energy_j=found.get(f"sum power {name}", math.nan) * period,
        estimates=tuple(watched),
    )
