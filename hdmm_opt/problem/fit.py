"""Whether the sections of a study fit its machine."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence

import numpy as np

from stability.loops.stack import MAX_DELAY
from trajectories import Reference

from ..errors import InvalidInputError
from ..machines.body import ground_at
from ..machines.machine import Machine, kind_of
from ..names import nearest
from ..plants import Plant
from ..study import Study
from ..study.validation import ScenarioSection
from .member import GainRange

_SUFFIX = {"m": "m", "m/s": "m_s", "N m": "nm", "A": "a", "rad": "rad", "rad/s": "rad_s", "N": "n", "Pa": "pa"}


def check_disturbances(study: Study, machine: Machine) -> Iterator[InvalidInputError]:
    """The study's disturbances are those of the machine."""
    kinds = {d.kind: d for d in machine.disturbances}
    given, known = study.uncertainty.disturbances, list(kinds)
    for name in given:
        if name not in known:
            yield InvalidInputError(f'unknown key "uncertainty.disturbances.{name}"; {nearest(name, known)}')
    for name, disturbance in kinds.items():
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
        if machine.free and low == high:
            yield InvalidInputError(
                f"uncertainty.disturbances.{name} is an empty range: got [{low:g}, {high:g}]; widen it"
            )
        if not machine.free and given[name].rate is not None:
            yield InvalidInputError(
                f"uncertainty.disturbances.{name}.rate has no meaning here: {name} is constant in a run; remove it"
            )
        if disturbance.course == "constant" and (low < 0 or given[name].course == "any"):
            yield InvalidInputError(
                f"uncertainty.disturbances.{name} is a constant of 0 or more: got [{low:g}, {high:g}]; correct it"
            )


def check_scenarios(study: Study, machine: Machine) -> Iterator[InvalidInputError]:
    """Scenarios name parameters that there are, and faults that fit the inputs."""
    pairs = list(zip(machine.members, machine.plants, strict=True))
    known = {key for _, plant in pairs for key in plant.parameters}
    known |= {f"{name}.{key}" for name, plant in pairs for key in plant.parameters}
    constants = {d.name for d in machine.disturbances if d.course == "constant"}
    met = {name for d in machine.disturbances for name in (d.name, d.kind)}
    for scenario in study.validation.scenarios:
        where = f"validation.scenarios.{scenario.name}"
        for name in scenario.parameters:
            if name not in known:
                yield InvalidInputError(f"{where}.parameters.{name} is unknown; {nearest(name, sorted(known))}")
        for name, course in scenario.disturbances.items():
            if name not in met:
                yield InvalidInputError(f"{where}.disturbances.{name} is unknown; {nearest(name, sorted(met))}")
            if name in constants and len({value for _, value in course}) > 1:
                yield InvalidInputError(f"{where}.disturbances.{name} is constant in a run; give one number")
        yield from _check_ground(f"{where}.ground", scenario, machine)
        for name, plant in pairs:
            stuck = scenario.faults[name].stuck if name in scenario.faults else ()
            if len(stuck) > len(plant.inputs):
                yield InvalidInputError(
                    f"{where}.faults.{name}.stuck has at most one entry for each of "
                    f"{', '.join(plant.inputs)}: got {len(stuck)}; remove what is too much"
                )


def _check_ground(where: str, scenario: ScenarioSection, machine: Machine) -> Iterator[InvalidInputError]:
    """The ground's signals are those of the machine's body, which makes the disturbances that follow from them."""
    if scenario.ground is None:
        return
    if machine.body is None:
        yield InvalidInputError(f"{where} has no place here: {machine.name} has no body that moves over it; remove it")
        return
    body = machine.body
    known = {name: signal for signal in body.signals for name in (signal.name, kind_of(signal.name))}
    good = True
    for name, course in scenario.ground.items():
        if name not in known:
            good = False
            yield InvalidInputError(f"{where}.{name} is unknown; {nearest(name, sorted(known))}")
            continue
        low, high = known[name].range
        outside = [value for _, value in course if not low <= value <= high]
        if outside:
            good = False
            yield InvalidInputError(f"{where}.{name} is from {low:g} to {high:g}: got {outside[0]:g}; correct it")
    made = {kind for name in body.met for kind in (name, kind_of(name))}
    for name in sorted(made & set(scenario.disturbances)):
        yield InvalidInputError(f"{where} makes {name} itself: it has a course in disturbances too; remove one")
    for time in sorted({t for course in scenario.ground.values() for t, _ in course} | {0.0}) if good else ():
        told = body.holds([float(value) for value in ground_at(body, scenario.ground, np.array([time]))[:, 0]])
        if told:
            yield InvalidInputError(f"{where}: at {time:g} s the ground {told}; give more grip or less slope")
            return


def check_rates(study: Study, machine: Machine) -> Iterator[InvalidInputError]:
    """All control rates divide the fastest one, at which the computing delay is of so many periods at most."""
    rates = {name: study.controller.rate_of(name) for name in machine.members}
    fastest, delay = max(rates.values()), study.controller.delay_s
    if delay * fastest > MAX_DELAY:
        yield InvalidInputError(
            f"controller.delay_s is at most {MAX_DELAY} control periods: got {delay:g} s, {delay * fastest:.3g} "
            f"periods at {fastest:g} Hz; {MAX_DELAY / fastest:g} s would do, or a rate of {MAX_DELAY / delay:.4g} Hz"
        )
    jitter = study.controller.jitter_s
    if jitter > delay or 2 * jitter * fastest >= 1:
        yield InvalidInputError(
            f"controller.jitter_s is at most the delay, and less than half a period: got {jitter:g} s with a delay of "
            f"{delay:g} s at {fastest:g} Hz; {min(delay, 0.45 / fastest):g} s would do"
        )
    for name, rate in rates.items():
        if abs(round(fastest / rate) * rate / fastest - 1) > 1e-9:
            yield InvalidInputError(
                f"controller.rates_hz.{name} must divide the fastest rate, {fastest:g} Hz: got {rate:g}; "
                f"{fastest / round(fastest / rate):g} would do"
            )


def check_observer(study: Study, machine: Machine, ranges: Mapping[str, Sequence[GainRange]]) -> None:
    """An observer makes position and speed of a position; it is around the reference, where no network acts.

    Raises:
        InvalidInputError: they do not fit.
    """
    if study.controller.observer is None:
        return
    for name, plant in zip(machine.members, machine.plants, strict=True):
        if plant.first != "position" or len(plant.states) < 2 or plant.targets[1] != 0:
            raise InvalidInputError(
                f"controller.observer makes a speed of a position: {name} has {', '.join(plant.states)}; remove it"
            )
        speed = plant.states[1]
        noisy = next((key for key in (state_key(plant, speed), speed) if study.uncertainty.noise.get(key, 0.0) > 0), "")
        if noisy:
            raise InvalidInputError(
                f"uncertainty.noise.{noisy} has no meaning with controller.observer, which estimates it; remove it"
            )
        if any(item.name == "gamma_1" and item.high > 0 for item in ranges[name]):
            raise InvalidInputError(
                "gamma_1, a load network of the first row, has no place beside controller.observer; remove one"
            )


def check_monitor(study: Study, machine: Machine) -> Iterator[InvalidInputError]:
    """A monitor watches limits of one signal, and estimates what no disturbance moves; it needs measured states."""
    monitor = study.controller.monitor
    if monitor is None:
        return
    if study.controller.observer is not None:
        yield InvalidInputError("controller.monitor has no place beside controller.observer; remove one")
    for name, plant in zip(machine.members, machine.plants, strict=True):
        known = [limit.name for limit in plant.limits if len(limit.signals) == 1]
        for limit in monitor.limits:
            if limit not in known:
                yield InvalidInputError(f"controller.monitor.limits.{limit} is unknown; {nearest(limit, known)}")
        for limit in plant.limits:
            signal = limit.signals[0]
            if limit.name in monitor.limits and signal in plant.states and plant.feels(signal):
                yield InvalidInputError(
                    f"controller.monitor.limits.{limit.name}: the {signal} of {name} feels a disturbance, and cannot "
                    "be estimated from what is measured; remove it"
                )


def check_motion(machine: Machine, references: tuple[Reference, ...]) -> None:
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
    """The key of a state in a study: its name and its unit; the name alone of one without a usual unit."""
    suffix = _SUFFIX.get(plant.state_units[plant.states.index(state)])
    return state if suffix is None else f"{state}_{suffix}"


def check_states(section: str, given: Mapping[str, float], machine: Machine) -> Iterator[InvalidInputError]:
    """Keys are names of states, alone or with their unit."""
    shown = list(dict.fromkeys(state_key(plant, s) for plant in machine.plants for s in plant.states))
    known = [*shown, *(s for plant in machine.plants for s in plant.states)]
    for name in given:
        if name not in known:
            yield InvalidInputError(f'unknown key "{section}.{name}"; {nearest(name, shown)}')


def check_shared(machine: Machine, values: Mapping[str, tuple[float, ...]], kind: str) -> Iterator[InvalidInputError]:
    """States of one name have one bound in all members."""
    found: dict[str, float] = {}
    for name, plant in zip(machine.members, machine.plants, strict=True):
        for state, value in zip(plant.states, values[name], strict=True):
            if found.setdefault(state, value) != value:
                yield InvalidInputError(
                    f'uncertainty.{kind} gives "{state}" in two units: got {found[state]:g} and {value:g}; '
                    "name it once, without a unit"
                )
