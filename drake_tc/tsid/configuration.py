"""A controller as a YAML file: robot, contacts, tasks, limits, formulation, solver; the README here has the keys."""

import math
import time
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from drake_tc.control.torque_uncertainty_file import load_torque_uncertainty
from drake_tc.errors import ParamsError
from drake_tc.robot import fields
from drake_tc.robot.mounts import Mount
from drake_tc.robot.packages import resolve
from drake_tc.robot.plant import joint_limits
from drake_tc.robot.robot import Robot, load_robot
from drake_tc.robot.rotors import file_rotors
from drake_tc.tsid.contacts import Contact
from drake_tc.tsid.law import Law
from drake_tc.tsid.limit_fields import read_limits
from drake_tc.tsid.model import TsidModel
from drake_tc.tsid.priority_fields import read_priorities, without_priorities
from drake_tc.tsid.qp.choose import DEFAULT, solver
from drake_tc.tsid.robust.budget import Budget
from drake_tc.tsid.robust.formulation import Formulation
from drake_tc.tsid.robust.options import Options
from drake_tc.tsid.robust.torque_error import TorqueError
from drake_tc.tsid.task_fields import numbers, read_task
from drake_tc.yaml_file import merged, read_yaml

_NUMBERS = ("contact_damping", "fallback_damping", "fade")
_REQUIRED = ("robot", "tasks")
_OPTIONAL = (
    "contacts",
    "frames",
    "limits",
    "formulation",
    "sigma",
    "solver",
    "period",
    "rotor_inertia",
    *_NUMBERS,
)
_PLACE = ("xyz", "rpy")
_CONTACT = (
    "kind",
    "axes",
    "half_length",
    "half_width",
    "extents",
    "friction",
    "moment_friction",
    "minimum_force",
    "maximum_force",
)
_SOLE = ("half_length", "half_width", "extents", "moment_friction")
"""Keys of a contact that a point has no use for."""
PAPER_SHARE = 0.003
"""Of the effort limit: the paper's sigma."""


def load_law(path: Path | str, changes: Mapping[str, Any] | None = None) -> Law:
    """Read a controller file and build what it says.

    Args:
        path: YAML; drake_tc/tsid/README.md has the keys.
        changes: Laid over the file's mapping, field by field down into the maps.

    Raises:
        ParamsError: the file, its robot or its torque uncertainty cannot be read, a key is unknown, missing or given
            twice, or a value is not possible; the message names file and field.
    """
    source = Path(path)
    document = read_yaml(source, "controller file (YAML)")
    try:
        top = fields.mapping("controller", document, _REQUIRED, _OPTIONAL)
        return _law(source, fields.mapping("controller", merged(top, changes or {}), _REQUIRED, _OPTIONAL))
    except ParamsError as error:
        raise ParamsError(f"{source}: {error}") from None


def _law(source: Path, top: Mapping[str, Any]) -> Law:
    robot = load_robot(resolve(fields.text("robot", top["robot"]), source.parent))
    contacts = tuple(_contact(name, entry) for name, entry in _items("contacts", top))
    frames = tuple(_mount(f"frames.{name}", name, entry) for name, entry in _items("frames", top))
    model = TsidModel(robot, contacts, frames=frames, rotor_inertia=_rotors(top, robot))
    period = fields.number("period", top.get("period", 1e-3))
    entries = _items("tasks", top)
    if not entries:
        raise ParamsError("tasks: wanted at least one; got none")
    formulation = _formulation("formulation", top.get("formulation"))
    return Law(
        model=model,
        tasks=tuple(read_task(f"tasks.{name}", name, entry, model) for name, entry in without_priorities(entries)),
        limits=read_limits("limits", top.get("limits"), model, period),
        formulation=formulation,
        priorities=read_priorities(entries, top.get("formulation") or {}, formulation.measure),
        error=_error("sigma", top.get("sigma", PAPER_SHARE), robot, source.parent),
        solver=solver(fields.text("solver", top.get("solver", DEFAULT))),
        period=period,
        **{key: fields.number(key, top[key]) for key in _NUMBERS if key in top},
    )


def _items(key: str, top: Mapping[str, Any]) -> list[tuple[str, Any]]:
    """Entries by name; those that are null count as not there."""
    return [
        (name, entry) for name, entry in fields.mapping(key, top.get(key), optional=None).items() if entry is not None
    ]


def _mount(where: str, name: str, entry: object, more: tuple[str, ...] = ()) -> Mount:
    given = fields.mapping(where, entry, ("link",), (*_PLACE, *more))
    return Mount(name, fields.text(f"{where}.link", given["link"]), fields.pose(where, given))


def _contact(name: str, entry: object) -> Contact:
    where = f"contacts.{name}"
    frame = _mount(where, name, entry, _CONTACT)
    values: dict[str, Any] = {}
    for key, value in fields.mapping(where, entry, optional=None).items():
        at = f"{where}.{key}"
        if value is None and key in _CONTACT:
            continue
        if key in ("kind", "axes"):
            values[key] = fields.text(at, value)
        elif key == "extents":
            values[key] = _extents(at, value)
        elif key in _CONTACT:
            values[key] = fields.number(at, value, infinite=key == "maximum_force")
    idle = [key for key in _SOLE if key in values and values.get("kind") == "point"]
    if idle:
        raise ParamsError(f"{where}.{idle[0]}: wanted kind: surface beside it; a point has no sole")
    return Contact(name, frame, **values)


def _extents(where: str, value: object) -> tuple[float, ...]:
    if not isinstance(value, list) or len(value) != 4:
        raise ParamsError(f"{where}: wanted four numbers [x_min, x_max, y_min, y_max]; got {value!r}")
    return tuple(fields.number(where, item) for item in value)


def _rotors(top: Mapping[str, Any], robot: Robot) -> dict[str, float] | None:
    """Those given over those of the robot's files; None for the latter."""
    if top.get("rotor_inertia") is None:
        return None
    given = fields.mapping("rotor_inertia", top["rotor_inertia"], optional=robot.joints)
    own = {joint: fields.number(f"rotor_inertia.{joint}", value) for joint, value in given.items()}
    return {**file_rotors(robot), **own}


def _formulation(where: str, entry: object) -> Formulation:
    keys = ("measure", "use", "weight", "minimum", "accuracy", "iterations", "seconds", "priority")
    given = {key: value for key, value in fields.mapping(where, entry, optional=keys).items() if value is not None}
    values: dict[str, Any] = {
        key: fields.text(f"{where}.{key}", given[key]) for key in ("measure", "use") if key in given
    }
    values |= {key: fields.number(f"{where}.{key}", given[key]) for key in ("weight", "minimum") if key in given}
    _check_acting(where, given)
    try:
        seconds = fields.number(f"{where}.seconds", given["seconds"]) if "seconds" in given else math.inf
        iterations = _whole(f"{where}.iterations", given.get("iterations", Budget().iterations))
        budget = Budget(iterations, seconds, time.perf_counter)
        accuracy = fields.number(f"{where}.accuracy", given.get("accuracy", Options().accuracy))
        return Formulation(**values, options=Options(accuracy, budget))
    except ParamsError as error:
        raise ParamsError(str(error) if str(error).startswith(where) else f"{where}.{error}") from None


def _check_acting(where: str, given: Mapping[str, Any]) -> None:
    """Refuse what would change nothing."""
    use = given.get("use", "trade_off")
    if given.get("measure") == "classic" and use != "trade_off":
        raise ParamsError(f"{where}.use: wanted a measure of robustness beside {use}; measure: classic has none")
    if "minimum" in given and use != "constraint":
        raise ParamsError(f"{where}.minimum: wanted use: constraint beside it; got use: {use}")


def _whole(where: str, value: object) -> int:
    number = fields.number(where, value)
    if number != round(number) or number < 1:
        raise ParamsError(f"{where}: wanted a whole number >= 1; got {value!r}")
    return round(number)


def _error(where: str, entry: object, robot: Robot, folder: Path) -> TorqueError:
    """From a share of the efforts, sigmas (a list or by joint) or a torque uncertainty file."""
    if isinstance(entry, str) and Path(entry).suffix in (".yaml", ".yml"):
        return TorqueError(load_torque_uncertainty(resolve(entry, folder)).of(robot.joints))
    if isinstance(entry, dict):
        given = fields.mapping(where, entry, robot.joints)
        value: Any = [fields.number(f"{where}.{joint}", given[joint]) for joint in robot.joints]
    else:
        value = numbers(where, entry)
    sigma = np.array(value) if isinstance(value, list) else value * joint_limits(robot).effort
    if sigma.shape != (len(robot.joints),):
        raise ParamsError(f"{where}: wanted {len(robot.joints)} numbers, one a joint; got {sigma.size}")
    if not (np.isfinite(sigma).all() and (sigma >= 0.0).all()):
        raise ParamsError(f"{where}: wanted finite numbers >= 0 [N m]; got {sigma.tolist()}")
    return TorqueError(sigma**2)
