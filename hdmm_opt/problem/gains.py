"""The gains of a law as a study gives them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from types import MappingProxyType

from ..control import GainSpec
from ..errors import InvalidInputError
from ..names import nearest
from ..study.sections import GainSection
from .member import GainRange


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
        if not (low > 0 or (spec.zero and low == 0)):
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
