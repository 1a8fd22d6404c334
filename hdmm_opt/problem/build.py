"""From a study to a problem: machine, references, assumptions."""

from __future__ import annotations

from collections.abc import Iterator, Mapping

import numpy as np
from numpy.typing import NDArray

from stability import Bounds, Interval
from stability.networks.coupling import Slices
from stability.networks.observer import SampledObserver, sampled_bounds
from trajectories import Reference

from ..control.registry import law_for
from ..errors import InvalidInputError, refuse
from ..machines.machine import Machine
from ..machines.registry import model
from ..motions.references import references as made_references
from ..motions.slices import sliced
from ..names import nearest
from ..plants import Parameter, Plant
from ..study import Study
from .gains import gain_ranges, preloaded
from .member import Member
from .problem import Problem

Array = NDArray[np.float64]

#: Significant digits of the inertia that a member's own model carries.
DIGITS = 3
_SUFFIX = {"m": "m", "m/s": "m_s", "N m": "nm", "A": "a", "rad": "rad", "rad/s": "rad_s", "N": "n", "Pa": "pa"}


def assemble(study: Study, references: tuple[Reference, ...] | None = None) -> Problem:
    """Build the machine, its laws, its references and its assumptions.

    Args:
        study: A validated study.
        references: References that were already made for it, one a member.

    Raises:
        InvalidInputError: an unreachable reference, or sections that do not fit each other.
    """
    machine = model(study.plant.model).build(study.plant)
    sections = {"noise": study.uncertainty.noise, "initial": study.uncertainty.initial}
    refuse([
        *_check_disturbances(study, machine), *_check_scenarios(study, machine), *_check_rates(study, machine),
        *(error for kind, given in sections.items() for error in _check_states(f"uncertainty.{kind}", given, machine)),
    ])  # fmt: skip
    noise, initial = (
        {m: _by_state(given, machine, k) for k, m in enumerate(machine.members)} for given in sections.values()
    )
    refuse([*_same_everywhere(machine, noise, "noise"), *_same_everywhere(machine, initial, "initial")])
    laws = {m: law_for(study.controller.law, p, study.controller.modelling)
            for m, p in zip(machine.members, machine.plants, strict=True)}  # fmt: skip
    given = {m: _gains_of(study, m) for m in machine.members}
    ranges = {
        m: gain_ranges(laws[m].schema, *given[m], laws[m].derived(study.controller.rate_of(m), initial[m]))
        for m in machine.members
    }
    references = made_references(study, machine) if references is None else references
    slices = sliced(references)
    spans = {name: Interval(*d.range) for name, d in study.uncertainty.disturbances.items()}
    if machine.forces is not None:
        machine = machine.carrying(_carried(machine, slices, [spans[d.name].high for d in machine.disturbances]))
    loads = machine.loads(spans)
    foreseen = loads.feedforward(slices) if loads is not None else None
    _check_motion(machine, references)
    observers = _observers(study, machine)
    members = []
    for k, (name, plant) in enumerate(zip(machine.members, machine.plants, strict=True)):
        law = law_for(study.controller.law, plant, study.controller.modelling)
        bounds = _bounds(
            study, plant, references[k], 1 / study.controller.rate_of(name), spans, noise[name], initial[name],
            None if foreseen is None else foreseen[k],
        )  # fmt: skip
        named, loop = given[name][0], law.loop_model()
        chosen = preloaded(law, loop, bounds, ranges[name], operating_box(plant), named)
        accuracy = study.requirements.member_error.get(name, study.requirements.tracking_error_m)
        members.append(Member(
            name=name, plant=plant, law=law, model=loop, reference=references[k], bounds=bounds,
            box=operating_box(plant), ranges=chosen, accuracy=accuracy,
        ))  # fmt: skip
    return Problem(
        study=study, machine=machine, members=tuple(members), slices=slices, loads=loads, observers=observers
    )


def _check_disturbances(study: Study, machine: Machine) -> Iterator[InvalidInputError]:
    """The study's disturbances are those of the machine."""
    given, known = study.uncertainty.disturbances, [d.name for d in machine.disturbances]
    for name in given:
        if name not in known:
            yield InvalidInputError(f'unknown key "uncertainty.disturbances.{name}"; {nearest(name, known)}')
    for disturbance in machine.disturbances:
        name = disturbance.name
        if name not in given and set(given) <= set(known):
            yield InvalidInputError(f'"uncertainty.disturbances.{name}" is required and missing; give its range')
        if name not in given:
            continue
        low, high = given[name].range
        if given[name].unit not in (None, disturbance.unit):
            yield InvalidInputError(
                f'uncertainty.disturbances.{name}.unit must be "{disturbance.unit}": got "{given[name].unit}"; '
                "convert the range"
            )
        if machine.forces is None and low == high:
            yield InvalidInputError(
                f"uncertainty.disturbances.{name} is an empty range: got [{low:g}, {high:g}]; widen it"
            )
        if machine.forces is not None and given[name].rate is not None:
            yield InvalidInputError(
                f"uncertainty.disturbances.{name}.rate has no meaning here: {name} is constant in a run; remove it"
            )
        if disturbance.course == "constant" and (low < 0 or given[name].course == "any"):
            yield InvalidInputError(
                f"uncertainty.disturbances.{name} is a constant of 0 or more: got [{low:g}, {high:g}]; correct it"
            )


def _check_scenarios(study: Study, machine: Machine) -> Iterator[InvalidInputError]:
    """Scenarios name parameters that there are, and faults that fit the inputs."""
    pairs = list(zip(machine.members, machine.plants, strict=True))
    known = {key for _, plant in pairs for key in plant.parameters}
    known |= {f"{name}.{key}" for name, plant in pairs for key in plant.parameters}
    constants = {d.name for d in machine.disturbances if d.course == "constant"}
    for scenario in study.validation.scenarios:
        where = f"validation.scenarios.{scenario.name}"
        for name in scenario.parameters:
            if name not in known:
                yield InvalidInputError(f"{where}.parameters.{name} is unknown; {nearest(name, sorted(known))}")
        for name, course in scenario.disturbances.items():
            if name in constants and len({value for _, value in course}) > 1:
                yield InvalidInputError(f"{where}.disturbances.{name} is constant in a run; give one number")
        for name, plant in pairs:
            stuck = scenario.faults[name].stuck if name in scenario.faults else ()
            if len(stuck) > len(plant.inputs):
                yield InvalidInputError(
                    f"{where}.faults.{name}.stuck has at most one entry for each of "
                    f"{', '.join(plant.inputs)}: got {len(stuck)}; remove what is too much"
                )


def _check_rates(study: Study, machine: Machine) -> Iterator[InvalidInputError]:
    """All control rates divide the fastest one."""
    rates = {name: study.controller.rate_of(name) for name in machine.members}
    fastest = max(rates.values())
    for name, rate in rates.items():
        if abs(round(fastest / rate) * rate / fastest - 1) > 1e-9:
            yield InvalidInputError(
                f"controller.rates_hz.{name} must divide the fastest rate, {fastest:g} Hz: got {rate:g}; "
                f"{fastest / round(fastest / rate):g} would do"
            )


def _check_motion(machine: Machine, references: tuple[Reference, ...]) -> None:
    """No reference passes by itself what limits the rate of a first state."""
    for name, plant, reference in zip(machine.members, machine.plants, references, strict=True):
        if plant.first != "position" or len(plant.states) < 2:
            continue
        low, high = reference.bounds()[1]
        for limit in plant.limits:
            peak = max(-low, high)
            if limit.signals == (plant.states[1],) and not peak < limit.value:
                where = f"{name}: " if len(machine.members) > 1 else ""
                raise InvalidInputError(
                    f"reference: {where}its {limit.name} reaches {peak:.4g} {limit.unit}, the limit of the plant is "
                    f"{limit.value:.4g} {limit.unit}; allow more time or raise the limit"
                )


def state_key(plant: Plant, state: str) -> str:
    """The key of a state in a study: its name and its unit."""
    return f"{state}_{_SUFFIX[plant.state_units[plant.states.index(state)]]}"


def _check_states(section: str, given: Mapping[str, float], machine: Machine) -> Iterator[InvalidInputError]:
    """Keys are names of states, alone or with their unit."""
    shown = list(dict.fromkeys(state_key(plant, s) for plant in machine.plants for s in plant.states))
    known = [*shown, *(s for plant in machine.plants for s in plant.states)]
    for name in given:
        if name not in known:
            yield InvalidInputError(f'unknown key "{section}.{name}"; {nearest(name, shown)}')


def _by_state(given: Mapping[str, float], machine: Machine, k: int) -> tuple[float, ...]:
    """Values of a member's states."""
    plant = machine.plants[k]
    return tuple(given.get(state_key(plant, s), given.get(s, 0.0)) for s in plant.states)


def _same_everywhere(
    machine: Machine, values: Mapping[str, tuple[float, ...]], kind: str
) -> Iterator[InvalidInputError]:
    """States of one name have one bound in all members."""
    found: dict[str, float] = {}
    for name, plant in zip(machine.members, machine.plants, strict=True):
        for state, value in zip(plant.states, values[name], strict=True):
            if found.setdefault(state, value) != value:
                yield InvalidInputError(
                    f'uncertainty.{kind} gives "{state}" in two units: got {found[state]:g} and {value:g}; '
                    "name it once, without a unit"
                )


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
        rest=(float(reference(np.zeros(1))[0, 0]), study.reference.dwell_s),
    )


def _observers(study: Study, machine: Machine) -> dict[str, SampledObserver]:
    section, found = study.controller.observer, {}
    for name in machine.members if section is not None else ():
        assert section is not None
        rate = study.controller.rate_of(name)
        observer = SampledObserver.of_bandwidth(section.bandwidth_rad_s, section.largest, 1 / rate)
        if sampled_bounds(observer, noise=0.0, acceleration=1.0, initial=0.0) is None:
            raise InvalidInputError(
                f"controller.observer must contract for every adaptive scalar: got {section.bandwidth_rad_s:g} "
                f"rad/s with largest = {section.largest:g} at {rate:g} Hz; lower one of them"
            )
        found[name] = observer
    return found


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
