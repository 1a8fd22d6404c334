"""The gains of a law as a study gives them."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import replace
from types import MappingProxyType

import numpy as np
from numpy.typing import NDArray

from stability import Bounds, LoopModel, first_box
from stability.loops.box import UnboundedError

from ..control import GainSpec, ProvableLaw
from ..errors import InvalidInputError
from ..names import nearest
from ..study.sections import GainSection
from .member import GainRange

#: Significant digits of a preload, and what counts for none beside the range of the demand.
DIGITS, NOTHING = 3, 1e-3


def gain_ranges(
    schema: Sequence[GainSpec], given: Mapping[str, GainSection], where: str,
    derived: Mapping[str, tuple[float, float]] = MappingProxyType({}),
) -> tuple[GainRange, ...]:  # fmt: skip
    """Ranges in the order of the schema.

    Args:
        schema: The gains of the law.
        given: The entries of the study by name.
        where: Their place in the study, for messages.
        derived: Ranges of gains that the study may leave out.

    Raises:
        InvalidInputError: an unknown name, a missing gain without a default, or a gain that is not positive.
    """
    wanted = [spec.name for spec in schema]
    for name in given:
        if name not in wanted:
            raise InvalidInputError(f'unknown key "{where}.{name}"; {nearest(name, wanted)}')
    found = []
    for spec in schema:
        low, high = _ends(spec, given.get(spec.name), where, derived)
        if not (low > 0 or (spec.zero and low == 0) or spec.signed):
            raise InvalidInputError(f"{where}.{spec.name} must be positive: got {low:g}; correct the value")
        found.append(GainRange(name=spec.name, low=low, high=high, unit=spec.unit, meaning=spec.meaning))
    return tuple(found)


def _ends(
    spec: GainSpec, entry: GainSection | None, where: str, derived: Mapping[str, tuple[float, float]]
) -> tuple[float, float]:
    if entry is None and spec.default is None and spec.name in derived:
        return derived[spec.name]
    if entry is None and spec.default is None:
        raise InvalidInputError(f'"{where}.{spec.name}" is required and missing; give value, or min and max')
    if entry is None:
        return float(spec.default or 0.0), float(spec.default or 0.0)
    if entry.value is not None:
        return entry.value, entry.value
    return float(entry.min or 0.0), float(entry.max or 0.0)


def preloaded(
    law: ProvableLaw, model: LoopModel, bounds: Bounds, ranges: Sequence[GainRange], box: NDArray[np.float64],
    given: Collection[str],
) -> tuple[GainRange, ...]:  # fmt: skip
    """The ranges, with load networks that a study gives no preload starting at the middle of what they have to meet.

    Args:
        law: The law.
        model: Plant and law as data.
        bounds: Assumptions.
        ranges: The gains.
        box: Largest box of errors. Shape (n,).
        given: Names of the gains that the study gives.

    Raises:
        InvalidInputError: a network without a bound on its estimate.
    """
    named = {item.name: item for item in ranges}
    gains = law.rows_of([item.high for item in ranges])
    found = [k for k, g in enumerate(gains, 1) if g.gamma > 0]
    for k in found:
        if not named[f"phi_{k}"].low > 0:
            raise InvalidInputError(
                f"controller: phi_{k}, the largest estimate of a load network, must be positive where gamma_{k} is: "
                f"give its value in {named[f'phi_{k}'].unit}"
            )
    if not found:
        return tuple(ranges)
    try:
        start, _ = first_box(model, bounds, gains, 1e-9 * box)
    except UnboundedError:  # nothing can be proved then, and the search says why
        return tuple(ranges)
    for k, low, high in zip(found, start.low, start.high, strict=True):
        name = f"preload_{k}"
        if name not in given:
            middle = (low + high) / 2
            middle = float(f"{middle:.{DIGITS}g}") if abs(middle) > NOTHING * (high - low) else 0.0
            named[name] = replace(named[name], low=middle, high=middle)
    return tuple(named.values())
