"""From a study to a problem: machine, references, assumptions."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from stability import Bounds, Interval, Observer
from stability.networks.coupling import Slices
from trajectories import Reference

from ..control.registry import law_for
from ..errors import refuse
from ..machines.machine import Machine
from ..machines.registry import model
from ..motions.references import references as made_references
from ..motions.slices import sliced
from ..plants import Parameter, Plant
from ..study import Study
from .fit import (
    check_disturbances,
    check_monitor,
    check_motion,
    check_observer,
    check_rates,
    check_scenarios,
    check_shared,
    check_states,
    state_key,
)
from .gains import gain_ranges, preloaded
from .member import Member
from .problem import Problem

Array = NDArray[np.float64]

#: Significant digits of the inertia that a member's own model carries.
DIGITS = 3


def assemble(study: Study, references: tuple[Reference, ...] | None = None) -> Problem:
    """Build the machine, its laws, its references and its assumptions.

    Args:
        study: A validated study.
        references: References that were already made for it, one a member.

    Raises:
        InvalidInputError: an unreachable reference, or sections that do not fit each other.
    """
    machine = model(study.plant.model).build(study.plant)
    uncertainty = study.uncertainty
    sections = {"noise": uncertainty.noise, "resolution": uncertainty.resolution, "initial": uncertainty.initial}
    refuse([
        *check_disturbances(study, machine), *check_scenarios(study, machine), *check_rates(study, machine),
        *check_monitor(study, machine),
        *(error for kind, given in sections.items() for error in check_states(f"uncertainty.{kind}", given, machine)),
    ])  # fmt: skip
    found = {
        kind: {m: by_state(given, machine, k) for k, m in enumerate(machine.members)}
        for kind, given in sections.items()
    }
    refuse([error for kind, values in found.items() for error in check_shared(machine, values, kind)])
    noise, steps, initial = found.values()
    laws = {m: law_for(study.controller.law, p, study.controller.modelling)
            for m, p in zip(machine.members, machine.plants, strict=True)}  # fmt: skip
    given = {m: _gains_of(study, m) for m in machine.members}
    ranges = {
        m: gain_ranges(laws[m].schema, *given[m], laws[m].derived(study.controller.rate_of(m), initial[m]))
        for m in machine.members
    }
    check_observer(study, machine, ranges)
    references = made_references(study, machine) if references is None else references
    slices = sliced(references)
    spans = {name: Interval(*d.range) for name, d in study.uncertainty.disturbances.items()}
    if not machine.free:
        machine = machine.carrying(_carried(machine, slices, [spans[d.name].high for d in machine.disturbances]))
    loads = machine.loads(spans)
    foreseen = loads.feedforward(slices) if loads is not None else None
    check_motion(machine, references)
    members = []
    for k, (name, plant) in enumerate(zip(machine.members, machine.plants, strict=True)):
        law = law_for(study.controller.law, plant, study.controller.modelling)
        bounds = _bounds(
            study, plant, references[k], 1 / study.controller.rate_of(name), spans,
            tuple(own + step / 2 for own, step in zip(noise[name], steps[name], strict=True)), initial[name],
            None if foreseen is None else foreseen[k],
        )  # fmt: skip
        named, loop = given[name][0], law.loop_model()
        chosen = preloaded(law, loop, bounds, ranges[name], operating_box(plant), named)
        accuracy = study.requirements.member_error.get(name, study.requirements.tracking_error_m)
        members.append(Member(
            name=name, plant=plant, law=law, model=loop, reference=references[k], bounds=bounds,
            box=operating_box(plant), ranges=chosen, accuracy=accuracy, resolution=steps[name],
        ))  # fmt: skip
    return Problem(study=study, machine=machine, members=tuple(members), slices=slices, loads=loads)


def by_state(given: Mapping[str, float], machine: Machine, k: int) -> tuple[float, ...]:
    """Values of a member's states."""
    plant = machine.plants[k]
    return tuple(given.get(state_key(plant, s), given.get(s, 0.0)) for s in plant.states)


def _gains_of(study: Study, name: str) -> tuple[Mapping, str]:
    own = study.controller.members.get(name, {})
    where = f"controller.members.{name}" if own else "controller.gains"
    return {**study.controller.gains, **own}, where


def operating_box(plant: Plant) -> Array:
    """Errors beyond these are no operating point: a tenth of the stroke, and three times each limit."""
    box = [0.1 * (plant.stroke[1] - plant.stroke[0])]
    for state in plant.states[1:]:
        limits = [limit.value for limit in plant.limits if state in limit.signals]
        box.append(3.0 * (limits[0] if limits else plant.limits[0].value))
    return np.array(box)


def parameter_range(parameter: Parameter) -> Interval:
    """The assumed range of a parameter, rounded outwards; a point where the tolerance is zero."""
    if parameter.ends is not None:
        return Interval(*parameter.ends)
    if parameter.tolerance == 0 or parameter.value == 0:
        return Interval(parameter.value)
    spread = abs(parameter.value) * parameter.tolerance
    return Interval(parameter.value) + Interval.symmetric(spread * (1 + 1e-15))


def reference_ranges(reference: Reference) -> tuple[Interval, Interval, Interval, Interval]:
    """The reference and three derivatives, widened by a billionth: the checker recomputes them in exact arithmetic."""
    ranges = []
    for low, high in reference.bounds():
        room = 1e-9 * max(abs(low), abs(high))
        ranges.append(Interval(low - room, high + room))
    return (ranges[0], ranges[1], ranges[2], ranges[3])


def _bounds(
    study: Study, plant: Plant, reference: Reference, period: float, spans: Mapping[str, Interval],
    noise: tuple[float, ...], initial: tuple[float, ...], foreseen: tuple[Interval, Interval] | None,
) -> Bounds:  # fmt: skip
    """The assumptions of a member: its own disturbances, or the load of a coupling at the reference."""
    nominal, feedforward = dict(plant.values()), {}
    if foreseen is None:
        disturbances = {name: spans[name] for name in plant.disturbances}
        nominal |= {name: (value.low + value.high) / 2 for name, value in disturbances.items()}
        for name in plant.disturbances:
            rate = study.uncertainty.disturbances[name].rate
            if rate is not None:
                feedforward[name] = disturbances[name], Interval.symmetric(rate)
                disturbances[name] = Interval(0.0)
    else:
        (load,) = plant.disturbances
        disturbances, feedforward[load] = {load: Interval(0.0)}, foreseen
        nominal |= {} if "mechanics" in study.controller.modelling else {load: 0.0}
    return Bounds(
        parameters={name: parameter_range(p) for name, p in plant.parameters.items()},
        disturbances=disturbances,
        nominal=nominal,
        reference=reference_ranges(reference),
        noise=noise,
        initial=initial,
        period=period,
        transient=study.validation.transient_s,
        feedforward=feedforward,
        delay=study.controller.delay_s,
        jitter=study.controller.jitter_s,
        rest=(float(reference(np.zeros(1))[0, 0]), study.reference.dwell_s),
        observer=observer_at(study, period),
    )


def observer_at(study: Study, period: float) -> Observer | None:
    """The observer that a study asks for at a control period."""
    section = study.controller.observer
    return None if section is None else Observer.of_bandwidth(section.bandwidth_rad_s, period)


def _carried(machine: Machine, slices: Slices, disturbances: list[float]) -> tuple[float, ...]:
    """The middle of each member's inertia along the reference, in a few digits."""
    n, first = len(machine.members), [0 if p.first == "position" else None for p in machine.plants]
    middle = (slices.low + slices.high)[0] / 2
    still = [0.0] * n

    def inertia(x: Array, j: int) -> float:
        place = [value if order == 0 else 0.0 for value, order in zip(x, first, strict=True)]
        pushed, input_bound = (machine.forces(place, still, a, disturbances) for a in (np.eye(n)[j], still))
        return float(pushed[j]) - float(input_bound[j])

    found = np.array([[inertia(x, j) for j in range(n)] for x in middle.T])
    return tuple(float(f"{v:.{DIGITS}g}") for v in (found.min(axis=0) + found.max(axis=0)) / 2)
