"""Whether a plant is one: what is refused before a law is made for it."""

from __future__ import annotations

import re
from typing import Any

from ..errors import InvalidInputError
from .plant import Plant

_NAME = re.compile(r"[A-Za-z][A-Za-z0-9_]{0,63}")
#: Units of a first state.
FIRST = {"position": ("m", "rad"), "speed": ("m/s", "rad/s")}


def check_plant(plant: Any) -> Plant:
    """The plant, where it is in strict-feedback form and its parts fit each other.

    Raises:
        InvalidInputError: one line with the first thing that does not fit.
    """
    if not isinstance(plant, Plant):
        raise _wrong(f"build() must return a Plant: got {type(plant).__name__}", "return one")
    n, m = len(plant.states), len(plant.inputs)
    for what, count, wanted in (
        ("state_units", len(plant.state_units), n), ("targets", len(plant.targets), n),
        ("controlled", len(plant.controlled), n), ("input_map", len(plant.input_map), m),
        ("x", plant.x.numel(), n), ("u", plant.u.numel(), m), ("w", plant.w.numel(), len(plant.disturbances)),
        ("p", plant.p.numel(), len(plant.parameters)), ("mass", plant.mass.numel(), n),
        ("force", plant.force.numel(), n),
    ):  # fmt: skip
        if count != wanted:
            raise _wrong(f"{what} must have {wanted} entries: got {count}", "complete it")
    names = [*plant.states, *plant.inputs, *plant.disturbances, *plant.parameters]
    for name in names:
        if _NAME.fullmatch(name) is None or names.count(name) > 1:
            raise _wrong(f"names must be different plain identifiers: got {name!r:.40}", "rename it")
    if plant.state_units[0] not in FIRST[plant.first]:
        wanted = " or ".join(FIRST[plant.first])
        raise _wrong(f"a first {plant.first} must be in {wanted}: got {plant.state_units[0]!r:.20}", "convert it")
    _check_rows(plant)
    _check_symbols(plant)
    if not plant.limits or set(plant.limits[0].signals) != set(plant.inputs):
        raise _wrong("the first limit must be the amplitude limit of all inputs", "put it first")
    known = {*plant.states, *plant.inputs}
    for limit in plant.limits:
        if not set(limit.signals) <= known or not limit.value > 0:
            raise _wrong(f"limit {limit.name} must be above 0 and about states or inputs", "correct it")
    return plant


def _check_rows(plant: Plant) -> None:
    if plant.targets[0] != "reference" or not plant.controlled[0]:
        raise _wrong("the first row must track the reference under the law", 'start targets with "reference"')
    for i, target in enumerate(plant.targets):
        if target not in ("reference", "zero") and not (
            isinstance(target, int) and 0 <= target < i and plant.controlled[target]
        ):
            rule = f'target {i + 1} must be "reference", "zero" or a controlled row before it: got {target!r:.20}'
            raise _wrong(rule, "correct it")
    for row in plant.input_map:
        if not (0 <= row < len(plant.states) and plant.controlled[row]):
            raise _wrong(f"input_map names controlled rows: got {row}", "correct it")
    driven = {target for target in plant.targets if isinstance(target, int)} | set(plant.input_map)
    for i, controlled in enumerate(plant.controlled):
        if controlled and i not in driven:
            raise _wrong(f"nothing follows row {i + 1}, which the law acts in", "name it in targets or in input_map")


def _check_symbols(plant: Plant) -> None:
    import casadi as ca

    known = ca.vertcat(plant.x, plant.u, plant.w, plant.p)
    parts = {"mass": plant.mass, "force": plant.force, **{f"output {k}": v for k, v in plant.outputs.items()}}
    for what, part in parts.items():
        other = [str(s) for s in ca.symvar(part) if not any(ca.is_equal(s, k) for k in ca.vertsplit(known))]
        if other:
            raise _wrong(f"{what} reads {other[0]!r:.40}, which is none of x, u, w, p", "use those")
    if ca.depends_on(plant.mass, ca.vertcat(plant.x, plant.u, plant.w)):
        raise _wrong("mass may read parameters alone", "put the rest into force")


def _wrong(rule: str, remedy: str) -> InvalidInputError:
    return InvalidInputError(f"plant.model: {rule}; {remedy}")
