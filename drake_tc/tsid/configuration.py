"""A controller as a YAML file: robot, contacts, tasks, limits, formulation, solver; the README here has the keys.

What a controller file may say. `drake_tc.tsid.configuration` builds the controller.
"""

import math
import time
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Annotated, Any, ClassVar, get_args

import numpy as np
from pydantic import BeforeValidator, Field

from drake_tc.config.keys import (
    FileName,
    FourNumbers,
    Keys,
    Name,
    Number,
    NumberFromZero,
    UnboundedNumber,
    WholeNumber,
    key,
    one_of,
    unknown_key,
)
from drake_tc.config.quoted import quoted
from drake_tc.config.records import validated
from drake_tc.config.yaml_file import merged, read_yaml
from drake_tc.control.torque_uncertainty_file import load_torque_uncertainty
from drake_tc.errors import ParamsError
from drake_tc.robot.document import PoseKeys
from drake_tc.robot.fields import Mount
from drake_tc.robot.link_changes import link_changes
from drake_tc.robot.plant import file_rotors, joint_limits
from drake_tc.robot.robot import Robot, load_robot
from drake_tc.simulator_files.urdf import resolve
from drake_tc.tsid.contacts import Axes, Contact, Kind
from drake_tc.tsid.kinds import read_limits, read_task
from drake_tc.tsid.law import Law
from drake_tc.tsid.model import TsidModel
from drake_tc.tsid.priorities import read_priorities, without_priorities
from drake_tc.tsid.qp import DEFAULT, OF_DRAKE, PROGRAM, SOLVERS, solver
from drake_tc.tsid.robust.formulation import Formulation, MeasureName, Use
from drake_tc.tsid.robust.scaled import Budget, Options, TorqueError

PAPER_SHARE = 0.003
"""Of the effort limit: the paper's sigma."""
_SOLE = ("half_length", "half_width", "extents", "moment_friction")
"""Keys of a contact that a point has no use for."""


def _present(value: object) -> object:
    """Entries that are null count as not there."""
    return {name: entry for name, entry in value.items() if entry is not None} if isinstance(value, Mapping) else value


class FrameKeys(PoseKeys):
    """A frame on a link."""

    link: Name = key("Link of the frame.", example="r_hand", default=..., expected="the name of a link")

    def mount(self, name: str) -> Mount:
        """The frame."""
        return Mount(name, self.link, self.pose)


class ContactKeys(FrameKeys):
    """A place where the robot may push on its surroundings; z of its frame points out of the ground."""

    kind: Annotated[Kind, one_of(get_args(Kind))] | None = key(
        "A `surface` carries a wrench, a `point` carries a force.", example="point", absent=Contact.kind
    )
    axes: Annotated[Axes, one_of(get_args(Axes))] | None = key(
        "Axes of the force and of its friction cone: `link`, the contact's own, or `world` with z up, which a point "
        "alone may have: the cone of a point foot does not turn with its shank.",
        example="link",
        absent="`link` of a surface, `world` of a point",
    )
    half_length: Number | None = key("Half of a sole's length, along x.", unit="m", example=0.1, absent="`extents`")
    half_width: Number | None = key("Half of a sole's width, along y.", unit="m", example=0.05, absent="`extents`")
    extents: FourNumbers | None = key(
        "Edges [x_min, x_max, y_min, y_max] of a sole whose frame is not in its middle.",
        unit="m",
        example=[-0.05, 0.12, -0.05, 0.05],
        absent="the two halves",
    )
    friction: Number | None = key("Coefficient of friction.", unit="–", example=0.3, absent=f"{Contact.friction}")
    moment_friction: Number | None = key(
        "Largest moment about z over the normal force, of a surface.",
        unit="m",
        example=0.05,
        absent=f"{Contact.moment_friction}",
    )
    minimum_force: Number | None = key(
        "Smallest normal force.", unit="N", example=10.0, absent=f"{Contact.minimum_force}"
    )
    maximum_force: UnboundedNumber | None = key("Largest normal force.", unit="N", example=800.0, absent="not bounded")

    @classmethod
    def check_together(cls, value: Mapping[str, object]) -> None:
        """A point has no sole."""
        idle = [name for name in _SOLE if value.get(name) is not None]
        if idle and value.get("kind") == "point":
            raise ValueError(f"{idle[0]}: it belongs to `kind: surface`; a point has no sole")

    def contact(self, name: str) -> Contact:
        """The contact."""
        values = {key: value for key, value in self.given().items() if key not in PoseKeys.model_fields}
        values.pop("link")
        return Contact(name, self.mount(name), **values)


class FormulationKeys(Keys):
    """Which measure of robustness, what it is used for, and how long a tick may take."""

    measure: Annotated[MeasureName, one_of(get_args(MeasureName))] | None = key(
        "How the probability that no limit is missed is approximated; `classic` has no measure.",
        example="box",
        absent=Formulation.measure,
    )
    use: Annotated[Use, one_of(get_args(Use))] | None = key(
        "`trade_off` weighs tasks against the measure, `null_space` takes the best measure among the best for the "
        "tasks, `constraint` bounds the measure.",
        example="constraint",
        absent=Formulation.use,
    )
    weight: Number | None = key(
        "Weight of the measure in the trade-off.", unit="–", example=1e-5, absent=f"{Formulation.weight:g}"
    )
    minimum: Number | None = key(
        "Bound of the measure R = −log p with `use: constraint`.",
        unit="–",
        example=0.01,
        absent=f"{Formulation.minimum:g}",
    )
    accuracy: Number | None = key("Accuracy of the programs.", unit="–", example=1e-5, absent=f"{Options().accuracy:g}")
    iterations: WholeNumber | None = key(
        "Iterations of all programs of a tick, at most.", example=200, absent=f"{Budget().iterations}"
    )
    seconds: UnboundedNumber | None = key(
        "Time of a tick, at most. With it a simulation does not repeat itself.",
        unit="s",
        example=1e-3,
        absent="not bounded",
    )
    priority: WholeNumber | None = key(
        "Level of robustness among tasks on strict levels, in place of `use`, `weight` and `minimum`.",
        example=3,
        absent="below all tasks, where tasks have levels",
    )

    @classmethod
    def check_together(cls, value: Mapping[str, object]) -> None:
        """No key that would change nothing."""
        use = value.get("use") or Formulation.use
        if value.get("measure") == "classic" and use != Formulation.use:
            raise ValueError(f"use: expected a measure of robustness beside {use}; `measure: classic` has none")
        if value.get("minimum") is not None and use != "constraint":
            raise ValueError(f"minimum: it belongs to `use: constraint`, got use: {use}")


def _sigma(value: object) -> object:
    good = isinstance(value, int | float | list | Mapping | str) and not isinstance(value, bool)
    if not good or (isinstance(value, str) and not value.endswith((".yaml", ".yml"))):
        raise ValueError(
            "expected a share of the effort limits, a list of numbers, a mapping of joint to number, or the name of a "
            f"torque uncertainty file, got {quoted(value)}"
        )
    return value


Sigma = Annotated[Number | list[Number] | dict[str, Number] | str, BeforeValidator(_sigma)]


SOLVER_NAMES = (*SOLVERS, *OF_DRAKE, PROGRAM)
"""What `solver` may be."""


class ControllerDocument(Keys):
    """What a controller file may say."""

    SCHEMA: ClassVar[str] = "controller"

    robot: FileName = key(
        "Robot file, relative to this file, or `package://NAME/path`.",
        example="leg.yaml",
        default=...,
        expected="the name of a robot file",
    )
    tasks: Annotated[dict[str, dict[str, Any]], Field(min_length=1), BeforeValidator(_present)] = key(
        "By name, what the robot is to do: `kind`, the keys of the kind, and `priority` for strict levels.",
        example={"com": {"kind": "com", "kp": 100.0, "kd": 20.0}},
        default=...,
        expected="a mapping of name to task",
    )
    contacts: Annotated[dict[str, ContactKeys], BeforeValidator(_present)] | None = key(
        "By name, where the robot may push on its surroundings.",
        example={"left_sole": {"link": "l_foot", "half_length": 0.1, "half_width": 0.05}},
        absent="none",
    )
    frames: Annotated[dict[str, FrameKeys], BeforeValidator(_present)] | None = key(
        "By name, more frames for tasks.", example={"palm": {"link": "r_hand"}}, absent="none"
    )
    limits: dict[str, Any] | None = key(
        "By kind, limits and their keys; null takes away one that holds by default.",
        example={"torque": {"share": 0.8}},
        absent="`torque`, `contact` and `acceleration` with their defaults",
    )
    formulation: FormulationKeys | None = key(
        "How robustness is weighed.", example={"measure": "individual"}, absent="the defaults of its keys"
    )
    sigma: Sigma | None = key(
        "Standard deviation of the torques: a share of the effort limits, a list, a mapping by joint, or a "
        "`torque_uncertainty.yaml` of `close-loop` with a full covariance.",
        unit="N·m",
        example=[0.1, 0.2],
        absent=f"{PAPER_SHARE} of the effort limits",
    )
    solver: Annotated[str, Field(pattern=f"^({'|'.join(SOLVER_NAMES)})$"), one_of(SOLVER_NAMES)] | None = key(
        f"Solver of quadratic programs: {', '.join((*SOLVERS, *OF_DRAKE))}; or `{PROGRAM}`, which solves the whole"
        " tick as one MathematicalProgram of Drake, slowly and independently.",
        example="quadprog",
        absent=DEFAULT,
    )
    period: Number = key("Period of the controller.", unit="s", example=0.002, default=1e-3)
    rotor_inertia: dict[str, NumberFromZero] | None = key(
        "By joint, the rotor's inertia on the joint's side of the gear, in place of the robot's.",
        unit="kg m²",
        example={"r_knee": 0.8},
        absent="the robot file's, or its actuators'",
    )
    contact_damping: Number | None = key(
        "Damping of the contacts' motion. Where floors or soles give way, it fights their spring.",
        unit="1/s",
        example=10.0,
        absent="0",
    )
    fallback_damping: Number | None = key("Damping of the safe torque.", unit="N·m·s/rad", example=5.0, absent="5")
    fade: Number | None = key(
        "Time in which the torque falls to 1/e where the state is lost.", unit="s", example=0.1, absent="0.1"
    )


_NUMBERS = ("contact_damping", "fallback_damping", "fade")


def load_law(path: Path | str, changes: Mapping[str, Any] | None = None, actuators: Path | None = None) -> Law:
    """Read a controller file and build what it says.

    Args:
        path: YAML; `drake-tc schema controller --page` has the keys.
        changes: Laid over the file's mapping, field by field down into the maps.
        actuators: Actuator model file in place of the robot file's: rotors and found links are those that it has.

    Raises:
        ParamsError: the file, its robot or its torque uncertainty cannot be read, a key is unknown, missing or given
            twice, or a value is not possible; the message names file and field.

    Example:
        >>> law = load_law(MODELS / "hrp2_like" / "hrp2_like_tsid.yaml", {"tasks": {"posture": {"weight": 0.1}}})
        >>> [task.name for task in law.tasks][:2]
        ['com', 'posture']
    """
    source = Path(path)
    document = read_yaml(source, "controller file (YAML)")
    if changes and isinstance(document, Mapping):
        document = merged(document, changes)
    read = validated(ControllerDocument, document, str(source))
    try:
        return _law(source, read, actuators)
    except ParamsError as error:
        raise ParamsError(f"{source}: {error}") from None


def _law(source: Path, read: ControllerDocument, actuators: Path | None) -> Law:
    robot = load_robot(resolve(read.robot, source.parent), found_links=actuators is None)
    if actuators is not None:
        robot = replace(robot, actuators=actuators, changes=link_changes(actuators))
    contacts = tuple(entry.contact(name) for name, entry in (read.contacts or {}).items())
    frames = tuple(entry.mount(name) for name, entry in (read.frames or {}).items())
    model = TsidModel(robot, contacts, frames=frames, rotor_inertia=_rotors(read.rotor_inertia, robot))
    entries = list(read.tasks.items())
    formulation = read.formulation or FormulationKeys()
    made = _formulation(formulation)
    given = read.given()
    return Law(
        model=model,
        tasks=tuple(read_task(f"tasks.{name}", name, entry, model) for name, entry in without_priorities(entries)),
        limits=read_limits("limits", read.limits, model, read.period),
        formulation=made,
        priorities=read_priorities(entries, formulation.given(), made.measure),
        error=_error("sigma", PAPER_SHARE if read.sigma is None else read.sigma, robot, source.parent),
        solver=solver(read.solver or DEFAULT),
        period=read.period,
        **{name: given[name] for name in _NUMBERS if name in given},
    )


def _rotors(given: Mapping[str, float] | None, robot: Robot) -> dict[str, float] | None:
    """Those given over those of the robot's files; None for the latter."""
    if given is None:
        return None
    for joint in given:
        if joint not in robot.joints:
            raise ParamsError(f"rotor_inertia: {unknown_key(joint, robot.joints)}")
    return {**file_rotors(robot), **given}


def _formulation(read: FormulationKeys) -> Formulation:
    given = read.given()
    values = {name: given[name] for name in ("measure", "use", "weight", "minimum") if name in given}
    try:
        seconds = given.get("seconds", math.inf)
        budget = Budget(given.get("iterations", Budget().iterations), seconds, time.perf_counter)
        return Formulation(**values, options=Options(given.get("accuracy", Options().accuracy), budget))
    except ParamsError as error:
        raise ParamsError(f"formulation.{error}") from None


def _error(where: str, entry: Any, robot: Robot, folder: Path) -> TorqueError:
    """From a share of the efforts, sigmas (a list or by joint) or a torque uncertainty file."""
    if isinstance(entry, str):
        return TorqueError(load_torque_uncertainty(resolve(entry, folder)).of(robot.joints))
    if isinstance(entry, Mapping):
        for joint in entry:
            if joint not in robot.joints:
                raise ParamsError(f"{where}: {unknown_key(joint, robot.joints)}")
        for joint in robot.joints:
            if joint not in entry:
                raise ParamsError(f"{where}: {joint} is missing; expected a number [N m] for every joint")
        entry = [entry[joint] for joint in robot.joints]
    sigma = np.array(entry) if isinstance(entry, list) else entry * joint_limits(robot).effort
    if sigma.shape != (len(robot.joints),):
        raise ParamsError(f"{where}: expected {len(robot.joints)} numbers, one for each joint, got {sigma.size}")
    if not (np.isfinite(sigma).all() and (sigma >= 0.0).all()):
        raise ParamsError(f"{where}: expected finite numbers >= 0 [N m], got {quoted(sigma.tolist())}")
    return TorqueError(sigma**2)
