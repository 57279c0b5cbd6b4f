"""A design as the command line asks for it: which runs, which model, which joints and which goal."""

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from threadpoolctl import threadpool_limits

from drake_tc.actuation.model import ActuatorModel
from drake_tc.actuation.model_file import load_models
from drake_tc.config.files import is_file
from drake_tc.config.quoted import did_you_mean
from drake_tc.diagnosis.data.preparation import load_scale
from drake_tc.diagnosis.search import Progress
from drake_tc.errors import ParamsError
from drake_tc.experiments.design.goal import Goal, parse_goal
from drake_tc.experiments.design.joint import DesignJoint
from drake_tc.experiments.design.known import joint_from_logs, joint_from_model, limits_with
from drake_tc.experiments.design.load_design import LoadDesign, design_with_loads
from drake_tc.experiments.design.loads import KnownLoad
from drake_tc.experiments.design.motions import JointLimits
from drake_tc.experiments.design.robot import RobotDesign, RobotOptions, design_robot, robot_limits, robot_noise
from drake_tc.experiments.design.run import DesignOptions, JointDesign, design_joint
from drake_tc.experiments.fitted import FittedJoint
from drake_tc.experiments.sizes import sizes_found
from drake_tc.logs.prepare import load_runs
from drake_tc.logs.record import Run
from drake_tc.logs.rig import Rig, load_rig
from drake_tc.robot.robot import load_robot


@dataclass(frozen=True)
class DesignRequest:
    """What is asked for.

    Attributes:
        rig: Rig file.
        logs: Runs recorded so far.
        model: Model file, or None.
        goal: Text of the goal; None for that of the report, or parameters.
        after: report.json, or None.
        joints: Which; empty for all.
        limits: Given limits by name; None for those of the runs.
        loads: Known loads that the user can hang on the joint; empty for a design without any.
        declared: File of another simulator whose model is declared, or None.
    """

    rig: Path
    logs: tuple[Path, ...]
    model: Path | None
    goal: str | None
    after: Path | None
    joints: tuple[str, ...]
    limits: Mapping[str, Any]
    loads: tuple[KnownLoad, ...] = ()
    declared: Path | None = None


def designed(
    request: DesignRequest, options: DesignOptions, progress: Progress = lambda text, share: None
) -> dict[str, JointDesign | LoadDesign]:
    """The designed motion of each joint, or the experiment under the known loads of one joint.

    Raises:
        DrakeTcError: Input that cannot be used, limits that contradict each other, a goal that cannot be reached, or
            known loads and more than one joint.
    """
    rig = load_rig(request.rig, request.declared)
    models, goals, logs = _models(request, rig), _goals(request, rig), _given_logs(request)
    if request.loads and len(goals) > 1:
        raise ParamsError(
            f"--load: the loads hang on one joint, and the design is for {', '.join(goals)}; name one with --joint"
        )
    out: dict[str, JointDesign | LoadDesign] = {}
    with threadpool_limits(1):
        progress("reading", 0.0)
        runs = load_runs(logs, rig) if logs else []
        for number, (name, goal) in enumerate(goals.items()):

            def told(text: str, part: float, name: str = name, number: int = number) -> None:
                progress(f"{name}, {text}", (number + part) / len(goals))

            joint, limits, fitted = _known(request, rig, runs, name, models.get(name))
            if request.loads:
                out[name] = design_with_loads(joint, limits, goal, options, request.loads, fitted, told)
            else:
                out[name] = design_joint(joint, limits, goal, options, fitted, told)
    return out


def whole_robot(request: DesignRequest) -> bool:
    """Whether the request is for one motion of all joints: for parameters, on a rig with a robot.

    With a report, the goal must be given: otherwise the open question of each joint is the goal.
    """
    goal = request.goal or ("parameters" if request.after is None else "")
    if request.joints or not goal or not parse_goal(goal).whole:
        return False
    return load_rig(request.rig, request.declared).robot is not None


def designed_robot(
    request: DesignRequest, options: RobotOptions, progress: Progress = lambda text, share: None
) -> RobotDesign:
    """The designed motion of all joints of the rig's robot, for the noise of the runs where there are some.

    Raises:
        DrakeTcError: As `designed`; a robot whose links touch in its posture.
    """
    rig = load_rig(request.rig, request.declared)
    if rig.robot is None:
        raise ParamsError(f"{request.rig}: no robot; a motion of all joints needs the key `robot: FILE`")
    if request.limits.get("position") is not None:
        raise ParamsError("--position: a robot's position limits are those of its robot file and URDF")
    robot = load_robot(rig.robot, found_links=False)
    limits = robot_limits(robot, **request.limits)
    fitted = tuple(j for j in rig.joints if "rotor_inertia" in rig.declared[j] and not rig.declared[j]["rotor_inertia"])
    logs = _given_logs(request)
    with threadpool_limits(1):
        progress("reading", 0.0)
        noise = robot_noise(rig, robot, load_runs(logs, rig)) if logs else None
        return design_robot(robot, limits, replace(options, rotors=fitted, noise=noise), progress)


def _known(
    request: DesignRequest, rig: Rig, runs: Sequence[Run], name: str, model: ActuatorModel | None
) -> tuple[DesignJoint, JointLimits, FittedJoint | None]:
    """A joint as its logs show it, or its model alone, the limits of its motion, and its fit where there are logs."""
    if request.limits.get("torque") is not None and load_scale(rig, name).as_effort:
        raise ParamsError(
            f"--torque: joint {name}: nothing fixes the scale of its torques (load: unknown), so a limit in N m"
            " cannot be compared with them; declare drive_gain, or omit --torque"
        )
    if runs:
        joint, found, fitted = joint_from_logs(rig, runs, name, model)
        return joint, limits_with(found, request.limits, name), fitted
    if model is None:
        raise ParamsError(
            f"joint {name}: expected a log, a report or a model of it, got none; give --log RUN, --after report.json,"
            " or --model FILE"
        )
    limits = limits_with(None, request.limits, name)
    return joint_from_model(rig, name, model, limits), limits, None


def _models(request: DesignRequest, rig: Rig) -> dict[str, ActuatorModel]:
    """Of --model, or the model before of the report: the tied effects are what the design shall separate."""
    if request.model is None:
        return {}
    models = load_models(request.model)
    missing = [joint for joint in request.joints or rig.joints if joint not in models]
    if missing:
        raise ParamsError(f"{request.model}: no joint {missing[0]!r}; joints here: {', '.join(models)}")
    return models


def _goals(request: DesignRequest, rig: Rig) -> dict[str, Goal]:
    """The goal of each joint; of a report, the joints that have an open question.

    That is two effects that were not told apart, and otherwise narrower intervals of the effects that were found.
    """
    for joint in request.joints:
        if joint not in rig.joints:
            raise ParamsError(
                f"no joint {joint!r} in the rig{did_you_mean(joint, rig.joints)}; joints: {', '.join(rig.joints)}"
            )
    joints, out = request.joints or rig.joints, {}
    entries = {} if request.after is None else _report(request.after)["joints"]
    for joint in joints:
        entry, text = entries.get(joint), request.goal
        if request.after is not None and text is None:
            if entry is None:
                raise ParamsError(f"{request.after}: no joint {joint!r}; joints here: {', '.join(entries) or 'none'}")
            found = ",".join(e["id"] for e in entry.get("effects", []))
            ties = entry.get("indistinguishable")
            text = f"tell:{','.join(ties[0])}" if ties else f"parameters:{found}" if found else None
        if text is not None or request.after is None:
            out[joint] = replace(parse_goal(text or "parameters"), strengths=_sizes(entry or {}))
    if not out:
        raise ParamsError(
            f"{request.after}: no joint has indistinguishable or named effects, so the report leaves no question open; "
            "add --goal parameters for narrower intervals of the declared model, or --goal all to show every effect"
        )
    return out


def _sizes(entry: Mapping[str, Any]) -> dict[str, float]:
    """Sizes of the effects that a report found, by id."""
    return sizes_found(
        {
            found["id"]: {name: each.get("value") for name, each in found.get("parameters", {}).items()}
            for found in entry.get("effects", [])
        }
    )


def _report(path: Path) -> dict[str, Any]:
    try:
        read = json.loads(path.read_text(encoding="utf-8"))
    except OSError as error:
        raise ParamsError(
            f"{path}: expected the report.json of close-loop, which cannot be read: {error.strerror or error}"
        ) from None
    except (UnicodeDecodeError, json.JSONDecodeError):
        raise ParamsError(f"{path}: expected the report.json of close-loop, got a file that is not JSON") from None
    if not isinstance(read, dict) or not isinstance(read.get("joints"), dict):
        raise ParamsError(f"{path}: expected the report.json of close-loop, got JSON without `joints`")
    return read


def _given_logs(request: DesignRequest) -> list[Path]:
    """The logs of the request, or else the runs that its report was fitted to, as named there or beside it."""
    if request.logs or request.after is None:
        return list(request.logs)
    out, after = [], request.after
    for name in _report(after).get("logs", []):
        candidates = [Path(name), after.parent / name, after.parent / Path(name).name]
        found = next((each for each in candidates if is_file(each)), None)
        if found is None:
            raise ParamsError(f"{after}: its run {name} is not there any more; name the runs with --log")
        out.append(found)
    return out
