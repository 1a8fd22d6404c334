"""A whole study file: one schema for every machine."""

from __future__ import annotations

from collections.abc import Iterator

from pydantic import model_validator

from ..errors import RefusedKeyError
from ..machines.machine import kind_of
from ..machines.model import SINGLE
from ..machines.registry import model
from ..names import nearest
from .controller import ControllerSection, TuningSection
from .machine import PlantSection, UncertaintySection
from .messages import refused_together
from .reference import ReferenceSection
from .sections import Section, StudySection
from .validation import RequirementSection, ValidationSection, check_names


class Study(Section):
    """A study of a design."""

    study: StudySection
    plant: PlantSection
    uncertainty: UncertaintySection
    reference: ReferenceSection
    controller: ControllerSection
    requirements: RequirementSection
    tuning: TuningSection = TuningSection()
    validation: ValidationSection

    @property
    def members(self) -> tuple[str, ...]:
        """Names of the machine's members."""
        return model(self.plant.model).members(self.plant)

    @model_validator(mode="after")
    def _consistent(self) -> Study:
        check_names(scenario.name for scenario in self.validation.scenarios)
        refused_together([*self._members(), *self._courses(), *self._kind(), *self._limits()])
        return self

    def _kind(self) -> Iterator[RefusedKeyError]:
        kinds = model(self.plant.model).kinds
        if self.reference.kind not in kinds:
            wanted = " or ".join(f'"{kind}"' for kind in kinds)
            yield RefusedKeyError("reference.kind", f'is {wanted} for model = "{self.plant.model}"', "change it")

    def _limits(self) -> Iterator[RefusedKeyError]:
        given, known = self.reference.limits, model(self.plant.model).limited
        needed = SINGLE if SINGLE[0] in known else ()
        for key in needed if given is not None else ():
            if getattr(given, key) is None:
                yield RefusedKeyError(f"reference.limits.{key}", "is required and missing", "add it")
        for key, value in () if given is None else given:
            if value is not None and key not in known:
                rule = f'has no place with model = "{self.plant.model}"'
                yield RefusedKeyError(f"reference.limits.{key}", rule, nearest(key, known) if known else "remove it")
            elif isinstance(value, tuple) and len(value) != len(self.members):
                rule = f"must have one entry for each of {', '.join(self.members)}: got {len(value)}"
                yield RefusedKeyError(f"reference.limits.{key}", rule, "complete it")

    def _members(self) -> Iterator[RefusedKeyError]:
        members = self.members
        named = [(f"controller.members.{name}", name) for name in self.controller.members]
        named += [(f"controller.rates_hz.{name}", name) for name in self.controller.rates_hz]
        named += [(f"requirements.member_error.{name}", name) for name in self.requirements.member_error]
        for scenario in self.validation.scenarios:
            named += [(f"validation.scenarios.{scenario.name}.faults.{name}", name) for name in scenario.faults]
        for where, name in named:
            if name not in members:
                yield RefusedKeyError(where, "is not a member of this machine", nearest(name, members))
        for name in members if len(members) > 1 else ():
            if name not in self.requirements.member_error:
                yield RefusedKeyError(f"requirements.member_error.{name}", "is required and missing", "add it")
        count = len(self.reference.waypoints[0])
        if count != len(members):
            rule = f"must have one entry for each of {', '.join(members)}: got {count}"
            yield RefusedKeyError("reference.waypoints", rule, "complete them")

    def _courses(self) -> Iterator[RefusedKeyError]:
        ranges, unknown = self.uncertainty.disturbances, set()
        for scenario in self.validation.scenarios:
            for name, course in scenario.disturbances.items():
                where, kind = f"validation.scenarios.{scenario.name}.disturbances.{name}", kind_of(name)
                if kind not in ranges and kind in unknown:
                    continue
                if kind not in ranges:
                    unknown.add(kind)
                    yield RefusedKeyError(where, "is not a disturbance of the study", nearest(kind, ranges))
                    continue
                low, high = ranges[kind].range
                outside = [value for _, value in course if not low <= value <= high]
                if outside and low < high:  # an empty range is refused where the machine is known
                    rule = f"must stay inside uncertainty.disturbances.{kind} [{low:g}, {high:g}]: got {outside[0]:g}"
                    yield RefusedKeyError(where, rule, "widen the assumption or change the scenario")
