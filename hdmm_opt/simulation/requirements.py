"""Requirements of a study against figures of its runs."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence

from ..problem import Problem
from .figures import Figures

#: Requirement -> what must not exceed it: a figure of the output, or a group and an output of every member.
OUTPUT = {"tracking_error_m": "maximum_error_m", "settling_time_s": "settling_time_s"}
MEMBER = {
    "peak_torque_nm": ("peaks", "torque"), "rms_torque_nm": ("rms", "torque"),
    "peak_current_a": ("peaks", "current"), "rms_current_a": ("rms", "current"),
}  # fmt: skip
VOLTAGE = "peak_voltage_v"


def required(problem: Problem) -> dict[str, float]:
    """The study's requirements by name; those of an output or an input that no member has are left out."""
    given = problem.study.requirements.model_dump(exclude_none=True)
    errors = given.pop("member_error")
    given.pop("settling_band_m", None)
    found = {name: limit for name, limit in given.items() if name in OUTPUT or _holders(problem, name)}
    if len(problem.members) > 1:
        found |= {f"member_error.{name}": limit for name, limit in errors.items()}
    return found


def _holders(problem: Problem, name: str) -> list[str]:
    """Members that a requirement is about."""
    if name == VOLTAGE:
        return [m.name for m in problem.members if m.plant.input_unit == "V"]
    output, unit = MEMBER[name][1], "N m" if name.endswith("_nm") else "A"
    return [m.name for m in problem.members if m.plant.output_units.get(output) == unit]


def figure_of(problem: Problem, name: str, figures: Figures) -> float:
    """What a run reached of a requirement."""
    if name in OUTPUT:
        return getattr(figures, OUTPUT[name])
    if name.startswith("member_error."):
        return figures.members[name.removeprefix("member_error.")].maximum_error
    of = [figures.members[member] for member in _holders(problem, name)]
    if name == VOLTAGE:
        return max(m.peak_input for m in of)
    group, output = MEMBER[name]
    return max(getattr(m, group)[output] for m in of)


def missed(problem: Problem, name: str, figures: Figures) -> list[str]:
    """Requirements that a run missed, as text."""
    return missed_in(problem, [(name, figures)])


def missed_in(problem: Problem, runs: Sequence[tuple[str, Figures]]) -> list[str]:
    """Requirements that some of the named runs missed, one line each: the worst run, and how many more there are."""
    lost = [(name, figures.diverged_s) for name, figures in runs if figures.diverged]
    found = [f"lost at {lost[0][1]:.3g} s in scenario {lost[0][0]}{_more(len(lost))}"] if lost else []
    for requirement, limit in required(problem).items():
        values = [(figure_of(problem, requirement, figures), name) for name, figures in runs]
        bad = [(value, name) for value, name in values if not value <= limit]
        if bad:
            value, name = max(bad, key=lambda entry: math.inf if math.isnan(entry[0]) else entry[0])
            found.append(f"{requirement} = {limit:g} is missed in scenario {name}: {value:.4g}{_more(len(bad))}")
    return found


def _more(count: int) -> str:
    return "" if count == 1 else f", and in {count - 1} more"


def reached(problem: Problem, requirement: str, runs: Iterable[Figures]) -> float | None:
    """The largest figure of some runs; None where there are none."""
    return max((figure_of(problem, requirement, figures) for figures in runs), default=None)
