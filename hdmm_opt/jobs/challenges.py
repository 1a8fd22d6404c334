"""Scenarios on which tuned controllers are scored: those of the study, and what no controller was tuned on."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

from trajectories import Reference, constant

from ..files.sources import assumed_text
from ..plants import Parameter
from ..plants.elastic_emla import SENSORS, SPRING
from ..problem import Problem, assemble
from ..simulation import Scenario, scenarios
from ..study import validated

#: The parameter that stands for the gain of the plant; lags of drives and valves, and how slow they are tried, s.
GAIN, SLOW = "torque_scale", {"drive_lag": 1e-3, "valve_lag": 0.02}
#: A rigid actuator, and the one with a spring in its screw that stands for it, the sensor at either side.
RIGID, ELASTIC = ("pmsm_emla", "torque"), "elastic_emla"
#: So many times the assumed initial error.
FAR = 10.0


#: A problem and what is run in it.
Ground = tuple[Problem, list[Scenario]]


def challenges(problem: Problem, seed: int) -> list[Scenario]:
    """The study's scenarios, then a constant load, a far start, half and twice the gain, and a slow drive, all noisy.

    Args:
        problem: The problem.
        seed: Seed of the noise.

    Those that the machine has no parameter or no disturbance for are left out. Not all are inside the assumptions.
    """
    return [*scenarios(problem), *_more(problem, seed)]


def grounds(problem: Problem, seed: int) -> list[Ground]:
    """What tuned controllers are scored on, each with the problem in which it runs.

    Args:
        problem: The problem.
        seed: Seed of the noise.

    Returns:
        The challenges; a period more of delay; a rest, with noise alone; and of a rigid actuator under a torque the
        same one with a screw that is a spring of assumed stiffness, with the sensor at the motor and at the rod.
    """
    late = tuple(m.under(replace(m.bounds, delay=m.bounds.delay + m.bounds.period)) for m in problem.members)
    still = tuple(
        replace(m, reference=Reference(segments=(constant(float(m.reference(0.0)[0, 0]), 0.0, problem.duration),)))
        for m in problem.members
    )
    late_run, still_run, *sprung = (
        Scenario(name=name, noise=1.0, seed=seed + k)
        for k, name in enumerate(("late", "noise-only", "spring-at-motor", "spring-at-load"), 4)
    )
    return [
        (problem, challenges(problem, seed)), (replace(problem, members=late), [late_run]),
        (replace(problem, members=still), [still_run]),
        *((ground, [run]) for ground, run in zip(_elastic(problem), sprung, strict=False)),
    ]  # fmt: skip


def assumed_of(problem: Problem) -> str:
    """What of a comparison has no public source, in one line: of the machine, and of the springs it is tried on."""
    text = assumed_text(problem)
    if _rigid(problem):
        spring = ", ".join(f"{name} {p.value:g} {p.unit}" for name, p in SPRING.items())
        text += f", the screw where it is a spring ({spring})"
    return text


def _rigid(problem: Problem) -> bool:
    plant = problem.study.plant
    return (plant.model, plant.level) == RIGID


def _elastic(problem: Problem) -> Iterator[Problem]:
    """The problem with a screw that is a spring; the laws keep what they know of the plant."""
    if _rigid(problem):
        for sensor in SENSORS:
            data = problem.study.model_dump(mode="json", exclude_none=True)
            data["plant"] |= {"model": ELASTIC, "sensor": sensor}
            data["controller"]["modelling"] = []  # what a law foresees, it foresees of its own plant
            yield assemble(validated(data, problem.study.study.name))


def _more(problem: Problem, seed: int) -> Iterator[Scenario]:
    high = {d.name: ((0.0, problem.disturbance(d.name).high),) for d in problem.machine.disturbances}
    if high:
        yield Scenario(name="held-load", disturbances=high, noise=1.0, seed=seed)
    yield Scenario(name="far-start", initial=FAR, noise=1.0, seed=seed + 1)
    plants = [member.plant for member in problem.members]
    if all(GAIN in plant.parameters for plant in plants):
        for name, factor in (("half-gain", 0.5), ("double-gain", 2.0)):
            share = {GAIN: _position(plants[0].parameters[GAIN], factor * plants[0].parameters[GAIN].value)}
            yield Scenario(name=name, disturbances=high, parameters=share, noise=1.0, seed=seed + 2)
    for lag in [lag for lag in SLOW if all(lag in plant.parameters for plant in plants)]:
        share = {lag: _position(plants[0].parameters[lag], SLOW[lag])}
        yield Scenario(name="slow-drive", disturbances=high, parameters=share, noise=1.0, seed=seed + 3)


def _position(parameter: Parameter, value: float) -> float:
    """Where a value lies in a parameter's tolerance, beyond -1 and 1 where it is outside."""
    return (value / parameter.value - 1) / parameter.tolerance if parameter.tolerance else 0.0
