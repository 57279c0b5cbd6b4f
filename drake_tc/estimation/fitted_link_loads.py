"""Joint torques with the links' inertial parameters of a model file, in place of those of the URDF."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from drake_tc.actuation.model_file import load_model_file
from drake_tc.config.quoted import did_you_mean
from drake_tc.errors import ParamsError
from drake_tc.estimation.robot_loads import RobotLogs, smoothed_motion
from drake_tc.logs.record import Run
from drake_tc.robot.link_parameters import LinkModel
from drake_tc.robot.rigid_regressor import LINK_PARAMETERS
from drake_tc.types import FloatArray


def fitted_links(path: Path | str, links: LinkModel) -> FloatArray:
    """Pi (10 n,) of a model file that `close-loop` wrote, in the order of `links.tree.parameters`.

    Raises:
        ParamsError: the file cannot be read, has no links, lacks one of the robot's or one of its parameters.
    """
    known = load_model_file(path).links
    if not known:
        raise ParamsError(
            f"{path}: links: expected the links' parameters, got none; close-loop writes them to model_after.yaml with "
            "`load: {robot: fitted}`"
        )
    return np.concatenate([_of_link(path, known.get(name, {}), name, list(known)) for name in links.tree.links])


def _of_link(path: Path | str, given: Mapping[str, object], name: str, known: Sequence[str]) -> FloatArray:
    """(10,) of one link."""
    if not given:
        raise ParamsError(
            f"{path}: links: no link {name!r}{did_you_mean(name, known)}; links there: {', '.join(known)}"
        )
    for parameter in LINK_PARAMETERS:
        value = given.get(parameter)
        if not isinstance(value, int | float) or not np.isfinite(value):
            raise ParamsError(f"{path}: links: {name}: {parameter}: expected a number, got {value!r}")
    return np.array([given[parameter] for parameter in LINK_PARAMETERS], dtype=np.float64)


def with_fitted_links(
    logs: RobotLogs, links: LinkModel, runs: Sequence[Run], joints: Sequence[str], parameters: FloatArray
) -> list[Run]:
    """The runs with tau + Y (pi - pi_0) as `<joint>/torque` [N m].

    Args:
        logs: The robot.
        links: Of its file, with pi_0.
        runs: With the torques of pi_0 (`with_robot_loads`).
        joints: Of the rig.
        parameters: pi (10 n,).
    """
    change = parameters - links.nominal
    out = []
    for run in runs:
        torque = {joint: run.columns[f"{joint}/torque"].copy() for joint in joints}
        for part, q, v, vdot in smoothed_motion(logs, run):
            more = logs.at_motors(links.columns(q, v, vdot) @ change)
            for joint, values in torque.items():
                values[part] += more[:, logs.robot.joints.index(joint)]
        columns = {f"{joint}/torque": values for joint, values in torque.items()}
        out.append(replace(run, columns=dict(run.columns) | columns))
    return out
