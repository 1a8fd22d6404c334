"""A study made concrete: plant, law, reference, assumptions, and the closed loop that simulates it."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from stability import Bounds, Interval
from trajectories import Reference

from .axis import KINDS, Axis, GainRange, parameter_range, reference_ranges
from .control import RAC
from .errors import InvalidInputError
from .motion import build_reference
from .plants import Plant, pmsm_emla
from .simulation import ClosedLoop, Yardstick
from .study import GainSection, Study, nearest, validated

Array = NDArray[np.float64]

_SUFFIX = {"m": "m", "m/s": "m_s", "N m": "nm", "A": "a"}


@dataclass(frozen=True, kw_only=True)
class Problem(Axis):
    """Everything that the pipeline works on: an axis with its study.

    Attributes:
        study: The study.
        loop: The closed loop for simulation.
    """

    study: Study
    loop: ClosedLoop


def assemble(study: Study, reference: Reference | None = None) -> Problem:
    """Build the plant, the law, the reference and the assumptions of a study.

    Args:
        study: A validated study.
        reference: A reference that was already built for it.

    Raises:
        InvalidInputError: an unreachable reference, or a section that does not fit the plant.
    """
    plant = pmsm_emla(study.plant.level, study.plant.resolved())
    try:
        law = RAC(plant=plant, modelling=study.controller.modelling)
    except ValueError as error:
        raise InvalidInputError(f"controller: {error}") from None
    for scenario in study.validation.scenarios:
        stuck = scenario.fault.stuck if scenario.fault else ()
        if len(stuck) > len(plant.inputs):
            raise InvalidInputError(
                f"validation.scenarios.{scenario.name}.fault.stuck has at most one entry for each of "
                f"{', '.join(plant.inputs)}: got {len(stuck)}; remove what is too much"
            )
    noise = _by_state("uncertainty.noise", study.uncertainty.noise, plant)
    initial = _by_state("uncertainty.initial", study.uncertainty.initial, plant)
    ranges = gain_ranges(law, study.controller.gains)
    reference = build_reference(study, plant) if reference is None else reference
    if not study.validation.transient_s < reference.duration:
        raise InvalidInputError(
            f"validation.transient_s ends before the reference does: got {study.validation.transient_s:g} s of "
            f"{reference.duration:g} s; shorten the transient"
        )
    low, high = study.uncertainty.load_force_n
    nominal = {**plant.values(), "load_force": (low + high) / 2}
    bounds = Bounds(
        parameters={name: parameter_range(p) for name, p in plant.parameters.items()},
        disturbances={"load_force": Interval(low, high)},
        nominal=nominal,
        reference=reference_ranges(reference),
        noise=noise,
        initial=initial,
        period=1 / study.controller.rate_hz,
        transient=study.validation.transient_s,
    )
    yardstick = Yardstick(
        transient=study.validation.transient_s, band=study.requirements.tracking_error_m,
        transmission=plant.parameters["transmission"].value,
    )  # fmt: skip
    loop = ClosedLoop(
        law=law, period=bounds.period, noise=noise, initial=initial, nominal_load=nominal["load_force"],
        yardstick=yardstick,
    )  # fmt: skip
    return Problem(
        study=study, plant=plant, law=law, model=law.loop_model(), reference=reference, bounds=bounds,
        box=operating_box(plant), ranges=ranges, loop=loop,
    )  # fmt: skip


def operating_box(plant: Plant) -> Array:
    """Errors beyond these are no operating point: a tenth of the stroke, and three times each limit."""
    box = [0.1 * (plant.stroke[1] - plant.stroke[0])]
    for state in plant.states[1:]:
        limits = [limit.value for limit in plant.limits if state in limit.signals]
        box.append(3.0 * (limits[0] if limits else plant.limits[0].value))
    return np.array(box)


def state_key(plant: Plant, state: str) -> str:
    """The key of a state in a study: its name and its unit."""
    unit = plant.state_units[plant.states.index(state)]
    return f"{state}_{_SUFFIX[unit]}"


def _by_state(section: str, given: dict[str, float], plant: Plant) -> tuple[float, ...]:
    keys = [state_key(plant, state) for state in plant.states]
    for name in given:
        if name not in keys:
            raise InvalidInputError(f'unknown key "{section}.{name}"; {nearest(name, keys)}')
    return tuple(given.get(key, 0.0) for key in keys)


def gain_ranges(law: RAC, given: Mapping[str, GainSection], where: str = "controller.gains") -> tuple[GainRange, ...]:
    """The gains of a law as a study gives them.

    Args:
        law: The law.
        given: The entries of the study by name; ε is 0, δ and σ are 1 where they are left out.
        where: Their place in the study, for messages.

    Raises:
        InvalidInputError: an unknown name, a missing β, or a gain that is not positive.
    """
    wanted = [f"{kind}_{k + 1}" for k in range(len(law.governed)) for kind in KINDS]
    for name in given:
        if name not in wanted:
            raise InvalidInputError(f'unknown key "{where}.{name}"; {nearest(name, wanted)}')
    defaults = {"epsilon": 0.0, "delta": 1.0, "sigma": 1.0}
    result = []
    for k, row in enumerate(law.governed):
        for kind in KINDS:
            name = f"{kind}_{k + 1}"
            entry = given.get(name)
            if entry is None and kind == "beta":
                raise InvalidInputError(f'"{where}.{name}" is required and missing; give value, or min and max')
            if entry is None:
                low = high = defaults[kind]
            elif entry.value is not None:
                low = high = entry.value
            else:
                low, high = float(entry.min or 0.0), float(entry.max or 0.0)
            if kind != "epsilon" and not low > 0:
                raise InvalidInputError(f"{where}.{name} must be positive: got {low:g}; correct the value")
            result.append(GainRange(name=name, low=low, high=high, unit=_unit(law, row, kind)))
    return tuple(result)


def _unit(law: RAC, row: int, kind: str) -> str:
    """Units: β maps Q_i to κ_i, ε θ̂ has the unit of β, θ̂ that of ε Q² / (2σ)."""
    own = law.rows[row].unit
    followers = [r.unit for r in law.rows if r.target == row]
    control = followers[0] if followers else law.plant.input_unit
    if kind in ("delta", "sigma"):
        return "1" if kind == "delta" else "1/s"
    ratio = f"({control})/({own})"
    return ratio if kind == "beta" else f"sqrt({ratio}/s)/({own})"


def plant_data(plant: Plant) -> dict[str, Any]:
    """A plant with every parameter and limit, as JSON data."""
    return {
        "parameters": {
            name: {"value": p.value, "unit": p.unit, "tolerance": p.tolerance, "source": p.source, "meaning": p.meaning}
            for name, p in plant.parameters.items()
        },
        "limits": [
            {"name": x.name, "signals": list(x.signals), "value": x.value, "unit": x.unit, "source": x.source}
            for x in plant.limits
        ],
        "stroke_m": list(plant.stroke),
    }


def resolved(problem: Problem) -> dict[str, Any]:
    """The study with every default filled in, as JSON data for the gain file."""
    study, plant = problem.study, problem.plant
    data = study.model_dump(mode="json", exclude_none=True)
    data["plant"] |= plant_data(plant)
    data["uncertainty"] = {
        "disturbances": {"load_force": list(study.uncertainty.load_force_n)},
        "noise": dict(zip(plant.states, problem.bounds.noise, strict=True)),
        "initial": dict(zip(plant.states, problem.bounds.initial, strict=True)),
    }
    return data


def study_of(data: dict[str, Any]) -> Study:
    """The study that `resolved` came from.

    Raises:
        InvalidInputError: the section is not that of a study.
    """
    plain = json.loads(json.dumps(data))
    plain.pop("sha256", None)
    for key in ("limits", "stroke_m"):
        plain["plant"].pop(key, None)
    for parameter in plain["plant"]["parameters"].values():
        parameter.pop("meaning", None)
    uncertainty = plain["uncertainty"]
    if "disturbances" in uncertainty:
        plant = pmsm_emla(plain["plant"]["level"])
        keyed = {
            kind: {state_key(plant, state): value for state, value in uncertainty[kind].items()}
            for kind in ("noise", "initial")
        }
        plain["uncertainty"] = {"load_force_n": uncertainty["disturbances"]["load_force"], **keyed}
    return validated(plain, "study")
