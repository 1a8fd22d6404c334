"""Study files: what to design, for which machine, under which assumptions. TOML, validated, with one-line errors."""

from __future__ import annotations

import difflib
import math
import tomllib
from collections.abc import Iterator
from importlib import resources
from itertools import pairwise
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal, TypeVar

from pydantic import BaseModel, ConfigDict, Field, ValidationError, model_validator

from .errors import InvalidInputError
from .plants import Parameter, defaults

if TYPE_CHECKING:
    from .machine_study import MachineStudy
    from .motion_study import MotionStudy

T = TypeVar("T", bound=BaseModel)
Positive = Annotated[float, Field(gt=0)]
NonNegative = Annotated[float, Field(ge=0)]
Pair = tuple[float, float]


#: Names of runs that are not the study's.
RESERVED = ("worst-case", "witness")
#: No quantity of these machines is larger in SI units.
LARGEST = 1e12


class Section(BaseModel):
    """A section of a study file: unknown keys and infinite numbers are errors."""

    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False, strict=False)


class StudySection(Section):
    """Name of the study and what it is about."""

    name: Annotated[str, Field(pattern=r"^[A-Za-z0-9][A-Za-z0-9_-]{0,63}$")]
    publication: str = ""
    summary: str = ""


class ParameterSection(Section):
    """One plant parameter."""

    value: float
    unit: str
    tolerance: Annotated[float, Field(ge=0, lt=1)] | None = None
    source: Literal["table", "derived", "public", "assumed"]


class PlantSection(Section):
    """The machine."""

    model: Literal["pmsm_emla"]
    level: Literal["torque", "voltage"]
    parameters: dict[str, ParameterSection] = {}

    @model_validator(mode="after")
    def _known(self) -> PlantSection:
        known = defaults(self.level)
        for name, given in self.parameters.items():
            if name not in known:
                raise ValueError(f"|parameters.{name}|is not a parameter of {self.model}|{nearest(name, known)}")
            if given.unit != known[name].unit:
                raise ValueError(
                    f'|parameters.{name}.unit|must be "{known[name].unit}": got "{given.unit}"|convert the value'
                )
            if known[name].value > 0 and not given.value > 0:
                raise ValueError(f"|parameters.{name}.value|must be positive: got {given.value:g}|correct the sign")
        return self

    def resolved(self) -> dict[str, Parameter]:
        """All parameters of the plant, defaults included."""
        result = dict(defaults(self.level))
        for name, given in self.parameters.items():
            default = result[name]
            tolerance = default.tolerance if given.tolerance is None else given.tolerance
            result[name] = Parameter(
                value=given.value, unit=given.unit, tolerance=tolerance, source=given.source, meaning=default.meaning
            )
        return result


class UncertaintySection(Section):
    """What the proof covers besides parameter tolerances."""

    load_force_n: Pair
    noise: dict[str, NonNegative] = {}
    initial: dict[str, NonNegative] = {}

    @model_validator(mode="after")
    def _ordered(self) -> UncertaintySection:
        _ordered("load_force_n", self.load_force_n)
        return self


class MotionLimitSection(Section):
    """Limits of the reference."""

    speed_m_s: Positive
    acceleration_m_s2: Positive
    jerk_m_s3: Positive
    torque_nm: Positive | None = None
    current_a: Positive | None = None
    voltage_v: Positive | None = None


class ReferenceSection(Section):
    """The motion to follow: rest-to-rest moves through waypoints, with a dwell at each."""

    kind: Literal["quintic", "bspline"]
    waypoints_m: Annotated[tuple[float, ...], Field(min_length=2, max_length=50)]
    durations_s: Annotated[tuple[Positive, ...], Field(max_length=49)] = ()
    dwell_s: NonNegative = 0.5
    objective: Literal["time", "energy"] = "time"
    longest_s: Positive = 60.0
    spans: Annotated[int, Field(ge=6, le=200)] = 24
    limits: MotionLimitSection

    @model_validator(mode="after")
    def _complete(self) -> ReferenceSection:
        moves = len(self.waypoints_m) - 1
        timed = self.kind == "quintic" or self.objective == "energy"
        if timed and len(self.durations_s) != moves:
            raise ValueError(
                f"|durations_s|must give one duration for each of the {moves} moves: got {len(self.durations_s)}|"
                'list them, or use kind = "bspline" with objective = "time"'
            )
        if not timed and self.durations_s:
            raise ValueError("|durations_s|has no place in a minimum-time reference|remove it")
        if any(a == b for a, b in pairwise(self.waypoints_m)):
            raise ValueError("|waypoints_m|must differ from one to the next|use dwell_s for a pause")
        return self


class GainSection(Section):
    """A gain: fixed by `value`, or searched between `min` and `max`."""

    value: Annotated[float, Field(ge=0)] | None = None
    min: Positive | None = None
    max: Positive | None = None

    @model_validator(mode="after")
    def _one_way(self) -> GainSection:
        if (self.value is None) == (self.min is None or self.max is None):
            raise ValueError("||needs either value, or min and max|give one of the two")
        if self.value is not None and (self.min is not None or self.max is not None):
            raise ValueError("||needs either value, or min and max: got both|remove one")
        if self.min is not None and self.max is not None:
            _ordered("", (self.min, self.max))
        return self


class ControllerSection(Section):
    """The law, its rate and its gains."""

    law: Literal["rac"]
    modelling: tuple[Literal["mechanics", "friction", "resistance", "back_emf", "decoupling"], ...] = ()
    rate_hz: Annotated[float, Field(gt=0, le=1e5)]
    gains: dict[str, GainSection]


class RequirementSection(Section):
    """What the design must meet, in every validated scenario."""

    tracking_error_m: Positive
    settling_time_s: Positive | None = None
    peak_torque_nm: Positive | None = None
    rms_torque_nm: Positive | None = None
    peak_current_a: Positive | None = None
    rms_current_a: Positive | None = None
    peak_voltage_v: Positive | None = None


class WeightSection(Section):
    """Weights of the closed-loop cost."""

    rms_error: NonNegative = 1.0
    certified_bound: NonNegative = 1.0
    itae: NonNegative = 0.2
    effort: NonNegative = 0.2

    @model_validator(mode="after")
    def _some(self) -> WeightSection:
        if not self.rms_error + self.certified_bound + self.itae + self.effort > 0:
            raise ValueError("||needs one weight above zero: got none|give rms_error or certified_bound a weight")
        return self


class TuningSection(Section):
    """Search budget of the second stage."""

    method: Literal["jaya", "tlbo", "random", "gradient"] = "jaya"
    population: Annotated[int, Field(ge=4, le=500)] = 20
    iterations: Annotated[int, Field(ge=0, le=10_000)] = 20
    seconds: Positive | None = None
    seed: Annotated[int, Field(ge=0)] = 1
    weights: WeightSection = WeightSection()


class FaultSection(Section):
    """An actuator that loses effectiveness; outside the assumptions of a proof."""

    share: Annotated[float, Field(ge=0, le=1)]
    start_s: NonNegative
    rate_1_s: Positive
    stuck: Annotated[tuple[float, ...], Field(max_length=2)] = ()


class ScenarioSection(Section):
    """One simulated run."""

    name: Annotated[str, Field(pattern=r"^[a-z0-9][a-z0-9_-]{0,63}$")]
    load_n: Annotated[tuple[Pair, ...], Field(min_length=1)]
    parameters: dict[str, Annotated[float, Field(ge=-1, le=1)]] = {}
    noise: Annotated[float, Field(ge=0, le=1)] = 0.0
    bias: Annotated[float, Field(ge=-1, le=1)] = 0.0
    initial: Annotated[float, Field(ge=-1, le=1)] = 0.0
    quantisation: Annotated[float, Field(ge=0, le=1)] = 0.0
    fault: FaultSection | None = None


class ValidationSection(Section):
    """Closed-loop runs after the proof."""

    transient_s: NonNegative = 1.0
    monte_carlo: Annotated[int, Field(ge=0, le=100_000)] = 200
    falsify: Annotated[int, Field(ge=0, le=1_000_000)] = 0
    worst_case: bool = True
    scenarios: Annotated[tuple[ScenarioSection, ...], Field(min_length=1)]


class Study(Section):
    """A whole study file."""

    study: StudySection
    plant: PlantSection
    uncertainty: UncertaintySection
    reference: ReferenceSection
    controller: ControllerSection
    requirements: RequirementSection
    tuning: TuningSection = TuningSection()
    validation: ValidationSection

    @model_validator(mode="after")
    def _consistent(self) -> Study:
        low, high = self.uncertainty.load_force_n
        names = [scenario.name for scenario in self.validation.scenarios]
        for name in names:
            if names.count(name) > 1 or name in RESERVED:
                reason = "twice" if names.count(name) > 1 else f"{name}, which hdmm-opt uses itself"
                raise ValueError(f"|validation.scenarios|needs names of its own: got {reason}|rename that scenario")
        for scenario in self.validation.scenarios:
            outside = [f for _, f in scenario.load_n if not low <= f <= high]
            if outside:
                raise ValueError(
                    f"|validation.scenarios.{scenario.name}|must keep its load inside uncertainty.load_force_n "
                    f"[{low:g}, {high:g}]: got {outside[0]:g}|widen the assumption or change the scenario"
                )
            times = [t for t, _ in scenario.load_n]
            if times[0] < 0:
                raise ValueError(
                    f"|validation.scenarios.{scenario.name}|needs times from 0 on in load_n: got {times[0]:g}|correct"
                )
            if any(b <= a for a, b in pairwise(times)):
                raise ValueError(f"|validation.scenarios.{scenario.name}|needs increasing times in load_n|sort them")
            for name in scenario.parameters:
                known = defaults(self.plant.level)
                if name not in known:
                    raise ValueError(
                        f"|validation.scenarios.{scenario.name}.parameters.{name}|is unknown|{nearest(name, known)}"
                    )
        return self


def _ordered(name: str, pair: Pair) -> None:
    low, high = pair
    if low > high:
        raise ValueError(f"|{name}|needs lower <= upper: got [{low:g}, {high:g}]|swap or correct them")
    if low == high:
        raise ValueError(f"|{name}|is an empty range: got [{low:g}, {high:g}]|widen it, or fix the value")


def nearest(name: str, known: Any) -> str:
    """Advice on a misspelt name: the nearest known one, or all of them."""
    close = difflib.get_close_matches(name, list(known), n=1, cutoff=0.4)
    return f'did you mean "{close[0]}"?' if close else "known: " + ", ".join(known)


def bundled() -> list[str]:
    """Names of the studies that come with the package."""
    folder = resources.files("hdmm_opt") / "studies"
    return sorted(entry.name.removesuffix(".toml") for entry in folder.iterdir() if entry.name.endswith(".toml"))


def load(name: str) -> Study:
    """Read a study of a design.

    Args:
        name: Name of a bundled study, or path of a TOML file.

    Returns:
        The validated study.

    Raises:
        InvalidInputError: one line with the rule, what came, and what would do.
    """
    found = load_any(name)
    if hasattr(found, "controller") and not isinstance(found, Study):
        raise InvalidInputError(
            f"{name}: this verb is for studies of one actuator: got a machine of several joints; use design, check, "
            "simulate, trajectory or compare"
        )
    if not isinstance(found, Study):
        raise InvalidInputError(
            f'{name}: a design needs a controller: this study is of a motion alone; use "hdmm-opt trajectory {name}"'
        )
    return found


def load_any(name: str) -> Study | MotionStudy | MachineStudy:
    """Read a study of a design of one axis or of a machine, or of a motion alone; as `load`."""
    if name in bundled():
        return parse((resources.files("hdmm_opt") / "studies" / f"{name}.toml").read_text(encoding="utf-8"), name)
    path = Path(name)
    if path.suffix != ".toml" and not path.exists():
        raise InvalidInputError(
            f'no bundled study is named "{name}"; {nearest(name, bundled())} (or give a .toml path)'
        )
    try:
        return parse(path.read_text(encoding="utf-8"), str(path))
    except (OSError, UnicodeDecodeError) as error:
        reason = error.strerror if isinstance(error, OSError) and error.strerror else "it is not UTF-8 text"
        raise InvalidInputError(f"{path}: cannot read the study file: {reason}; check the path") from None


def parse(text: str, where: str) -> Study | MotionStudy | MachineStudy:
    """Read a study from TOML text; `where` names it in errors."""
    try:
        data = tomllib.loads(text)
    except tomllib.TOMLDecodeError as error:
        raise InvalidInputError(f"{where}: not valid TOML: {error}; correct that line") from None
    return parse_data(data, where)


def parse_data(data: dict[str, Any], where: str) -> Study | MotionStudy | MachineStudy:
    """Validate a study of any kind given as data; its machine and its sections tell the kind."""
    plant = data.get("plant")
    model = plant.get("model") if isinstance(plant, dict) else None
    if model == "arm" or (model == "crane" and "controller" in data):
        from .machine_study import MachineStudy

        return _validated(data, where, MachineStudy)
    if model == "crane":
        from .motion_study import MotionStudy

        return _validated(data, where, MotionStudy)
    return validated(data, where)


def validated(data: dict[str, Any], where: str) -> Study:
    """Validate a study given as data; `where` names it in errors.

    Raises:
        InvalidInputError: one line with the rule, what came, and what would do.
    """
    return _validated(data, where, Study)


def _validated(data: dict[str, Any], where: str, kind: type[T]) -> T:
    try:
        numbers = list(_numbers(data))
    except InvalidInputError as error:
        raise InvalidInputError(f"{where}: {error}") from None
    for path, value in numbers:
        if math.isfinite(value) and abs(value) > LARGEST:
            raise InvalidInputError(
                f"{where}: {path} must be within ±{LARGEST:g} in SI units: got {value:g}; check the unit"
            )
    try:
        return kind.model_validate(data)
    except ValidationError as error:
        raise InvalidInputError(f"{where}: {_one_line(error, kind)}") from None


def _numbers(data: Any, path: str = "") -> Iterator[tuple[str, float]]:
    """Every number of a file with its place."""
    if isinstance(data, dict):
        for key, value in data.items():
            yield from _numbers(value, f"{path}.{key}" if path else str(key))
    elif isinstance(data, list):
        for value in data:
            yield from _numbers(value, path)
    elif isinstance(data, bool) and not path.endswith("worst_case"):
        raise InvalidInputError(f"{path} must be a number or text: got {str(data).lower()}; correct the value")
    elif isinstance(data, int | float):
        yield path, float(data) if isinstance(data, float) or abs(data) < 10**300 else math.copysign(1e300, data)


def _one_line(error: ValidationError, whole: type[BaseModel]) -> str:
    """The first problem as one line: the rule, what came, what would do."""
    problems = error.errors()
    first = next((p for p in problems if p["type"] == "extra_forbidden"), problems[0])
    place = [str(part) for part in first["loc"]]
    path, kind, value = ".".join(place), first["type"], first["input"]
    shown = repr(value) if isinstance(value, str) else f"{value}"
    shown = shown if len(shown) <= 40 else shown[:37] + "..."
    if kind == "extra_forbidden":
        return f'unknown key "{path}"; {nearest(place[-1], _known_keys(whole, place[:-1]))}'
    if kind == "missing":
        return f'"{path}" is required and missing; add it'
    if kind == "value_error":
        _, field, rule, remedy = first["msg"].removeprefix("Value error, ").split("|")
        full = ".".join(part for part in (path, field) if part)
        return f"{full} {rule}; {remedy}"
    if kind == "finite_number" or (isinstance(value, float) and not math.isfinite(value)):
        return f"{path} must be a finite number: got {shown}; give a number"
    if kind == "literal_error":
        return f"{path} must be {first.get('ctx', {}).get('expected', 'a known word')}: got {shown}; choose one"
    if kind == "too_short":
        least = first.get("ctx", {}).get("min_length", 1)
        return f"{path} must have at least {least} entries: got {shown}; add what is missing"
    if kind == "tuple_type":
        return f"{path} must be a list: got {shown}; put it in brackets"
    rule = first["msg"].replace("Input should be", "must be")
    return f"{path} {rule[0].lower()}{rule[1:]}: got {shown}; correct the value"


def _known_keys(whole: Any, place: list[str]) -> list[str]:
    """Field names of the section at a place of the file."""
    section: Any = whole
    for part in place:
        annotation = section.model_fields[part].annotation if part in getattr(section, "model_fields", {}) else None
        found = _models(annotation)
        if found:
            section = found[0]
    return list(section.model_fields)


def _models(annotation: Any) -> list[type[BaseModel]]:
    """The section classes in a type."""
    if isinstance(annotation, type) and issubclass(annotation, BaseModel):
        return [annotation]
    return [model for part in getattr(annotation, "__args__", ()) for model in _models(part)]
