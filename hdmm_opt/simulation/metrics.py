"""Figures of a simulated run."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from .loop import Trace


@dataclass(frozen=True, kw_only=True)
class Metrics:
    """What a run did.

    Attributes:
        maximum_error_m: Largest |tracking error| after the transient.
        rms_error_m: RMS tracking error after the transient.
        settling_time_s: First time after which |error| stays inside the required band; the length of the run where
            it never does.
        peak_torque_nm, rms_torque_nm: Motor torque over the whole run.
        peak_current_a, rms_current_a: Amplitude of the phase current over the whole run.
        peak_input: Largest norm of the input, N m or V.
        energy_j: Mechanical energy that the motor delivers, with sign.
        itae: Integral of time times |error|, m s².
        diverged: The run ended early.
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
    diverged: bool


def measure(trace: Trace, transient: float, band: float, transmission: float) -> Metrics:
    """Compute the figures.

    Args:
        trace: The run.
        transient: Time that error figures leave out, s.
        band: Required |error| for the settling time, m.
        transmission: Rod travel per motor angle, m/rad.

    Returns:
        The figures; infinite errors for a diverged run.
    """
    step = trace.t[1] - trace.t[0]
    error = np.abs(trace.error)
    late = error[trace.t >= transient] if (trace.t >= transient).any() else error[-1:]
    outside = np.flatnonzero(error > band)
    settled = trace.t[min(outside[-1] + 1, trace.t.size - 1)] if outside.size else 0.0
    torque, current = trace.outputs["torque"], trace.outputs["current"]
    lost = trace.diverged
    return Metrics(
        maximum_error_m=float("inf") if lost else float(late.max()),
        rms_error_m=float("inf") if lost else float(np.sqrt(np.mean(late**2))),
        settling_time_s=float(settled),
        peak_torque_nm=float(np.abs(torque).max()),
        rms_torque_nm=float(np.sqrt(np.mean(torque**2))),
        peak_current_a=float(current.max()),
        rms_current_a=float(np.sqrt(np.mean(current**2))),
        peak_input=float(np.linalg.norm(trace.u, axis=0).max()),
        energy_j=float((torque * trace.x[1] / transmission).sum() * step),
        itae=float("inf") if lost else float((trace.t * error).sum() * step),
        diverged=lost,
    )
