"""Studies of a machine of several joints under a law: arms at torque level, the crane with EMLAs at voltage level."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field, model_validator

from .plants import defaults
from .plants.crane import LIFT, TELESCOPE, TILT
from .plants.crane_dynamics import JOINTS
from .study import (
    RESERVED,
    FaultSection,
    GainSection,
    NonNegative,
    Pair,
    ParameterSection,
    Positive,
    Section,
    StudySection,
    TuningSection,
    nearest,
)

Share = Annotated[float, Field(ge=-1, le=1)]
Name = Annotated[str, Field(pattern=r"^[A-Za-z][A-Za-z0-9_]{0,31}$")]


class DriveSection(Section):
    """The actuator of one joint: parameters of an EMLA, or what an arm's joint is driven by."""

    parameters: dict[str, ParameterSection] = Field(default_factory=dict)
    armature: ParameterSection | None = None
    torque: ParameterSection | None = None
    speed_limit: Positive | None = None
    least_effectiveness: Annotated[float, Field(ge=0, le=1)] = 1.0


class MachineSection(Section):
    """The machine: the crane with EMLAs, or an arm from a URDF file with a torque at every joint."""

    model: Literal["crane", "arm"]
    urdf: str | None = None
    tip_m: tuple[float, float, float] = (0.0, 0.0, 0.0)
    damping: NonNegative = 0.1
    parameters: dict[str, ParameterSection] = Field(default_factory=dict)
    joints: dict[Name, DriveSection] = Field(default_factory=dict)
    locked: dict[Name, float] = Field(default_factory=dict)

    @model_validator(mode="after")
    def _fitting(self) -> MachineSection:
        if self.model == "arm":
            return self._arm()
        for key, value in (("urdf", self.urdf), ("tip_m", any(self.tip_m))):
            if value:
                raise ValueError(f'|{key}|has no place with model = "crane"|remove it')
        known = defaults("voltage")
        for where, names in (("joints", self.joints), ("locked", self.locked)):
            for name in names:
                if name not in JOINTS:
                    raise ValueError(f"|{where}.{name}|is not a joint of the crane|{nearest(name, JOINTS)}")
        if len(self.locked) == len(JOINTS):
            raise ValueError("|locked|must leave a joint that moves: got all of them|unlock one")
        for name, stroke in self.locked.items():
            longest = {"lift": LIFT.stroke, "tilt": TILT.stroke}.get(name, TELESCOPE)
            if not 0 <= stroke <= longest:
                raise ValueError(f"|locked.{name}|is a stroke from 0 to {longest:g} m: got {stroke:g}|correct it")
        sections = [("parameters", self.parameters)]
        sections += [(f"joints.{name}.parameters", drive.parameters) for name, drive in self.joints.items()]
        for where, given in sections:
            for name, parameter in given.items():
                if name not in known or name == "load_mass":
                    raise ValueError(
                        f"|{where}.{name}|is not a parameter of an EMLA of the crane|{nearest(name, known)}"
                    )
                if parameter.unit != known[name].unit:
                    raise ValueError(
                        f'|{where}.{name}.unit|must be "{known[name].unit}": got "{parameter.unit}"|convert the value'
                    )
                if known[name].value > 0 and not parameter.value > 0:
                    raise ValueError(
                        f"|{where}.{name}.value|must be positive: got {parameter.value:g}|correct the sign"
                    )
        for name, drive in self.joints.items():
            for key in ("armature", "torque", "speed_limit"):
                if getattr(drive, key) is not None:
                    raise ValueError(f'|joints.{name}.{key}|has no place with model = "crane"|remove it')
        return self

    def _arm(self) -> MachineSection:
        if self.urdf is None:
            raise ValueError('|urdf|is required with model = "arm"|give a bundled name ("crane") or a path')
        if self.locked or self.parameters:
            key = "locked" if self.locked else "parameters"
            raise ValueError(f'|{key}|has no place with model = "arm"|remove it')
        if not self.joints:
            raise ValueError("|joints|needs the joints of the arm, from the ground on|give each a section")
        for name, drive in self.joints.items():
            for key in ("armature", "torque", "speed_limit"):
                if getattr(drive, key) is None:
                    raise ValueError(f"|joints.{name}.{key}|is required for a joint of an arm|add it")
            if drive.parameters:
                raise ValueError(f"|joints.{name}.parameters|has no place in an arm|give armature and torque")
            assert drive.armature is not None and drive.torque is not None
            if not (drive.armature.value >= 0 and drive.torque.value > 0):
                raise ValueError(
                    f"|joints.{name}|needs a torque above 0 and an armature of 0 or more|correct the values"
                )
        return self


class ErrorSection(Section):
    """Bounds in the units of a joint: position (rad or m), speed, and current where there is one."""

    position: NonNegative = 0.0
    speed: NonNegative = 0.0
    current_a: NonNegative = 0.0


class MachineUncertaintySection(Section):
    """What the proof covers besides parameter tolerances."""

    payload_kg: Pair
    noise: ErrorSection = ErrorSection()
    initial: ErrorSection = ErrorSection()

    @model_validator(mode="after")
    def _ordered(self) -> MachineUncertaintySection:
        low, high = self.payload_kg
        if not 0 <= low <= high:
            raise ValueError(f"|payload_kg|needs 0 <= lower <= upper: got [{low:g}, {high:g}]|correct them")
        return self


class MotionSection(Section):
    """The motion to follow: rest-to-rest moves through joint coordinates, with a dwell at each."""

    kind: Literal["bspline", "quintic"]
    waypoints: Annotated[tuple[tuple[float, ...], ...], Field(min_length=2, max_length=20)]
    durations_s: Annotated[tuple[Positive, ...], Field(max_length=19)] = ()
    dwell_s: NonNegative = 0.5
    pace: Annotated[float, Field(gt=0, le=1)] = 1.0
    jerk_weight: NonNegative = 0.05
    longest_s: Positive = 60.0
    spans: Annotated[int, Field(ge=6, le=200)] = 24

    @model_validator(mode="after")
    def _complete(self) -> MotionSection:
        moves = len(self.waypoints) - 1
        if len({len(place) for place in self.waypoints}) > 1:
            raise ValueError("|waypoints|must all have one entry for each joint|complete them")
        if self.kind == "quintic" and len(self.durations_s) != moves:
            raise ValueError(
                f"|durations_s|needs one duration for each of the {moves} moves: got {len(self.durations_s)}|list them"
            )
        if self.kind == "bspline" and self.durations_s:
            raise ValueError("|durations_s|has no place in a minimum-time motion|remove it; pace makes it slower")
        if any(a == b for a, b in zip(self.waypoints, self.waypoints[1:], strict=False)):
            raise ValueError("|waypoints|must differ from one to the next|use dwell_s for a pause")
        return self


class ObserverSection(Section):
    """A motion-state observer for every joint: position is measured, speed is not (P-4)."""

    bandwidth_rad_s: Positive
    largest: NonNegative = 0.1
    epsilon: NonNegative = 0.0
    sigma: Positive = 10.0


class MachineControllerSection(Section):
    """The law of every joint, its rate and its gains; `joints` holds gains that differ from joint to joint."""

    law: Literal["rac"]
    modelling: tuple[Literal["mechanics", "resistance", "back_emf", "decoupling"], ...] = ()
    rate_hz: Annotated[float, Field(gt=0, le=1e5)]
    gains: dict[str, GainSection] = Field(default_factory=dict)
    joints: dict[Name, dict[str, GainSection]] = Field(default_factory=dict)
    observer: ObserverSection | None = None


class MachineRequirementSection(Section):
    """What the design must meet: the tool's error, and that of each joint in its unit."""

    tool_error_m: Positive
    joint_error: dict[Name, Positive]


class MachineScenarioSection(Section):
    """One simulated run."""

    name: Annotated[str, Field(pattern=r"^[a-z0-9][a-z0-9_-]{0,63}$")]
    payload_kg: NonNegative | None = None
    parameters: dict[str, Share] = Field(default_factory=dict)
    noise: Annotated[float, Field(ge=0, le=1)] = 0.0
    quantisation: Annotated[float, Field(ge=0, le=1)] = 0.0
    initial: Share = 0.0
    faults: dict[Name, FaultSection] = Field(default_factory=dict)


class MachineValidationSection(Section):
    """Closed-loop runs after the proof."""

    transient_s: NonNegative = 1.0
    monte_carlo: Annotated[int, Field(ge=0, le=100_000)] = 20
    scenarios: Annotated[tuple[MachineScenarioSection, ...], Field(min_length=1)]


class MachineStudy(Section):
    """A whole file of this kind."""

    study: StudySection
    plant: MachineSection
    uncertainty: MachineUncertaintySection
    reference: MotionSection
    controller: MachineControllerSection
    requirements: MachineRequirementSection
    tuning: TuningSection = TuningSection()
    validation: MachineValidationSection

    @property
    def joints(self) -> tuple[str, ...]:
        """Names of the joints that have an actuator."""
        if self.plant.model == "arm":
            return tuple(self.plant.joints)
        return tuple(name for name in JOINTS if name not in self.plant.locked)

    @model_validator(mode="after")
    def _consistent(self) -> MachineStudy:
        joints = self.joints
        named = [(f"controller.joints.{name}", name) for name in self.controller.joints]
        named += [(f"requirements.joint_error.{name}", name) for name in self.requirements.joint_error]
        for scenario in self.validation.scenarios:
            named += [(f"validation.scenarios.{scenario.name}.faults.{name}", name) for name in scenario.faults]
        for where, name in named:
            if name not in joints:
                raise ValueError(f"|{where}|is not a joint of this machine|{nearest(name, joints)}")
        for name in joints:
            if name not in self.requirements.joint_error:
                raise ValueError(f"|requirements.joint_error.{name}|is required and missing|add it")
        if len(self.reference.waypoints[0]) != len(joints):
            raise ValueError(
                f"|reference.waypoints|must have one entry for each of {', '.join(joints)}: got "
                f"{len(self.reference.waypoints[0])}|complete them"
            )
        wanted = {"crane": "bspline", "arm": "quintic"}[self.plant.model]
        if self.reference.kind != wanted:
            raise ValueError(f'|reference.kind|is "{wanted}" for model = "{self.plant.model}"|change it')
        self._scenarios()
        return self

    def _scenarios(self) -> None:
        low, high = self.uncertainty.payload_kg
        names = [scenario.name for scenario in self.validation.scenarios]
        for scenario in self.validation.scenarios:
            if names.count(scenario.name) > 1 or scenario.name in RESERVED:
                reason = (
                    "one twice" if names.count(scenario.name) > 1 else f"{scenario.name}, which hdmm-opt uses itself"
                )
                raise ValueError(f"|validation.scenarios|needs names of its own: got {reason}|rename that scenario")
            if scenario.payload_kg is not None and not low <= scenario.payload_kg <= high:
                raise ValueError(
                    f"|validation.scenarios.{scenario.name}.payload_kg|must be inside uncertainty.payload_kg "
                    f"[{low:g}, {high:g}]: got {scenario.payload_kg:g}|widen the assumption or change the scenario"
                )
