"""A controller as a YAML file: robot, contacts, tasks, limits, formulation, solver; the README here has the keys."""

import math
import time
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from drake_tc.config.keys import unknown_key
from drake_tc.config.quoted import quoted
from drake_tc.config.records import validated
from drake_tc.config.yaml_file import merged, read_yaml
from drake_tc.control.torque_uncertainty_file import load_torque_uncertainty
from drake_tc.errors import ParamsError
from drake_tc.robot.plant import file_rotors, joint_limits
from drake_tc.robot.robot import Robot, load_robot
from drake_tc.simulator_files.urdf import resolve
from drake_tc.tsid.document import PAPER_SHARE, ControllerDocument, FormulationKeys
from drake_tc.tsid.kinds import read_limits, read_task
from drake_tc.tsid.law import Law
from drake_tc.tsid.model import TsidModel
from drake_tc.tsid.priorities import read_priorities, without_priorities
from drake_tc.tsid.qp.choose import DEFAULT, solver
from drake_tc.tsid.robust.formulation import Formulation
from drake_tc.tsid.robust.options import Budget, Options
from drake_tc.tsid.robust.torque_error import TorqueError

_NUMBERS = ("contact_damping", "fallback_damping", "fade")
HINT = "`drake-tc schema controller --page` explains every key"


def load_law(path: Path | str, changes: Mapping[str, Any] | None = None) -> Law:
    """Read a controller file and build what it says.

    Args:
        path: YAML; `drake-tc schema controller --page` has the keys.
        changes: Laid over the file's mapping, field by field down into the maps.

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
    read = validated(ControllerDocument, document, str(source), hint=HINT)
    try:
        return _law(source, read)
    except ParamsError as error:
        raise ParamsError(f"{source}: {error}") from None


def _law(source: Path, read: ControllerDocument) -> Law:
    robot = load_robot(resolve(read.robot, source.parent))
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
