"""Figures of a simulated run, as records that every engine accumulates."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..plants import Plant
from .system import Record

Array = NDArray[np.float64]


@dataclass(frozen=True, kw_only=True)
class Yardstick:
    """What the figures are measured by.

    Attributes:
        transient: Time that error figures leave out, s.
        band: Required |error| for the settling time, m.
        transmission: Rod travel per motor angle, m/rad.
    """

    transient: float
    band: float
    transmission: float


@dataclass(frozen=True, kw_only=True)
class Metrics:
    """What a run did.

    Attributes:
        maximum_error_m: Largest |tracking error| after the transient, between the control instants too.
        rms_error_m: RMS tracking error after the transient.
        settling_time_s: First time after which |error| stays inside the required band; the length of the run where
            it never does.
        peak_torque_nm, rms_torque_nm: Motor torque over the whole run.
        peak_current_a, rms_current_a: Amplitude of the phase current over the whole run.
        peak_input: Largest norm of the input, N m or V.
        energy_j: Mechanical energy that the motor delivers, with sign.
        itae: Integral of time times |error|, m s².
        largest_error_m: Largest |tracking error| at any time, between the control instants too.
        limit_use: Largest share of a limit of the plant that the run used; 1 where an input saturated.
        diverged: The run was lost: a value was not finite, or the error passed `DIVERGED`.
    """

    maximum_error_m: float
    rms_error_m: float
    settling_time_s: float
    peak_torque_nm: float
    rms_torque_nm: float
    peak_current_a: float
    rms_current_a: float
    peak_input: float
    energy_j: float
    itae: float
    largest_error_m: float
    limit_use: float
    diverged: bool


def records(
    plant: Plant, yardstick: Yardstick, x: Any, u: Any, r: Any, outputs: dict[str, Any], t: Any, tau: Any
) -> tuple[Record, ...]:
    """The figures as records.

    Args:
        plant: The plant, for its limits.
        yardstick: Transient and band.
        x: Symbols of the states. Shape (n,).
        u: Held input. Shape (m,).
        r: Reference position … jerk at the tick. Shape (4,). Between ticks it is continued by its Taylor polynomial:
            within a period T that misses the fourth derivative's T⁴/24.
        outputs: Torque and current, as expressions.
        t: Time of the tick, s.
        tau: Time since the tick, s.
    """
    import casadi as ca

    error = ca.fabs(x[0] - (r[0] + tau * (r[1] + tau * (r[2] / 2 + tau * (r[3] / 6)))))
    late = t >= yardstick.transient
    torque, current = outputs["torque"], outputs["current"]
    signals = {name: x[i] for i, name in enumerate(plant.states)} | {name: u[i] for i, name in enumerate(plant.inputs)}
    sizes = [_norm([signals[s] for s in limit.signals]) / limit.value for limit in plant.limits]
    use = sizes[0]
    for size in sizes[1:]:
        use = ca.fmax(use, size)
    return (
        Record(name="late", kind="max", value=ca.if_else(late, error, 0), between=True),
        Record(name="error", kind="max", value=error, between=True),
        Record(name="use", kind="max", value=use, between=True),
        Record(name="outside", kind="max", value=ca.if_else(error > yardstick.band, t, -1)),
        Record(name="squares", kind="sum", value=ca.if_else(late, error**2, 0)),
        Record(name="torque", kind="max", value=ca.fabs(torque)),
        Record(name="torque squares", kind="sum", value=torque**2),
        Record(name="current", kind="max", value=current),
        Record(name="current squares", kind="sum", value=current**2),
        Record(name="input", kind="max", value=_norm([u[i] for i in range(u.numel())])),
        Record(name="work", kind="sum", value=torque * x[1] / yardstick.transmission),
        Record(name="itae", kind="sum", value=t * error),
        Record(name="ever outside", kind="max", value=error > yardstick.band),
    )


def _norm(parts: list[Any]) -> Any:
    import casadi as ca

    return ca.fabs(parts[0]) if len(parts) == 1 else ca.sqrt(sum(part**2 for part in parts))


def metrics(found: dict[str, float], lost: float, yardstick: Yardstick, period: float, count: int) -> Metrics:
    """Figures from what a run accumulated.

    Args:
        found: Record name -> value.
        lost: Time at which the run was lost, s.
        yardstick: What the records were made with.
        period: Control period, s.
        count: Ticks of the run.

    Returns:
        The figures; infinite errors for a lost run, whose other figures end where it was lost.
    """
    gone = math.isfinite(lost)
    ticks = min(count, max(1, round(lost / period))) if gone else count
    late = int(np.count_nonzero(period * np.arange(ticks) >= yardstick.transient)) or 1
    settled = ticks * period if gone else found["outside"] + period if found["ever outside"] else 0.0
    return Metrics(
        maximum_error_m=math.inf if gone else found["late"],
        rms_error_m=math.inf if gone else math.sqrt(found["squares"] / late),
        settling_time_s=settled,
        peak_torque_nm=found["torque"],
        rms_torque_nm=math.sqrt(found["torque squares"] / ticks),
        peak_current_a=found["current"],
        rms_current_a=math.sqrt(found["current squares"] / ticks),
        peak_input=found["input"],
        energy_j=found["work"] * period,
        itae=math.inf if gone else found["itae"] * period,
        largest_error_m=math.inf if gone else found["error"],
        limit_use=found["use"],
        diverged=gone,
    )
