"""A recorded run driven through MuJoCo with a joint's terms: what the export is worth in its target.

The plant is that of Drake's free run: the motor's side of the gear under the recorded load torque, or the pendulum of
the rig file. Only the recorded command enters; MuJoCo integrates with its own `implicitfast`.
"""

import math
import os
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from typing import Any

import numpy as np

from drake_tc.actuation.model import ActuatorModel
from drake_tc.actuation.recorded_run import Link, in_plant, plant_side
from drake_tc.diagnosis.data.recordings import LONGEST, longest_stretch, recording_of
from drake_tc.errors import ParamsError
from drake_tc.exchange.mjcf import to_mjcf
from drake_tc.exchange.projection import Projection
from drake_tc.logs.record import Run
from drake_tc.logs.rig import Rig
from drake_tc.simulator_files.terms import Terms
from drake_tc.types import FloatArray

FINEST = 1e-3
"""Longest step of MuJoCo [s]; slower logs take several a sample."""
GRAVITY = 9.81


def mujoco_free_run(
    model: ActuatorModel, terms: Terms, rig: Rig, run: Run, longest: float = LONGEST
) -> tuple[FloatArray, FloatArray] | None:
    """(recorded, simulated) position (T,) [rad] over the longest usable stretch of a run; None where nothing can run.

    Args:
        model: The identified one: its sensor effects are taken off the load and put on the position.
        terms: What MuJoCo is given.
        rig: Of the run.
        run: Whose command drives it.
        longest: At most so much of it [s].

    Raises:
        ParamsError: MuJoCo is not installed, or refuses the model.
    """
    stretch = longest_stretch(run, longest)
    if stretch is None:
        return None
    recording = recording_of(rig, model.joint, run, stretch)
    if recording.loop is not None:
        return None
    placed = in_plant(model, recording)
    if placed is None:
        return None
    side = plant_side(*placed)
    recording = placed[1]
    substeps = max(1, math.ceil(recording.period / FINEST - 1e-9))
    load = side.load if recording.pendulum is None else np.zeros(0) if recording.load_torque is None else side.load
    position = simulate(
        terms,
        recording.pendulum,
        recording.command,
        load if load.size else np.zeros(recording.time.size),
        (side.start, recording.initial_velocity),
        recording.period,
        substeps,
    )
    return run.columns[f"{model.joint}/position"][stretch], side.shown(position)


def simulate(
    terms: Terms,
    pendulum: Link | None,
    command: FloatArray,
    load: FloatArray,
    start: tuple[float, float],
    period: float,
    substeps: int = 1,
) -> FloatArray:
    """(T,) position of one joint in MuJoCo [rad]; NaN from where the simulation is unstable.

    Args:
        terms: Of its actuator.
        pendulum: On the joint; None leaves the rotor alone.
        command: (T,) held over each period, in the drive's unit.
        load: (T,) torque that the joint passes on [N m].
        start: Position and velocity [rad, rad/s].
        period: Of command and load [s].
        substeps: Steps in one period.

    Raises:
        ParamsError: MuJoCo is not installed, or refuses the model.
    """
    mujoco: Any = _mujoco()
    step = period / substeps
    text = to_mjcf([Projection("joint", replace(terms, backlash=0.0), (), None)], step=step)
    text = text.replace(_LIGHT, _inertial(pendulum))
    try:
        model = mujoco.MjModel.from_xml_string(text)
    except ValueError as error:
        raise ParamsError(f"MuJoCo refuses the exported model: {' '.join(str(error).split())}") from None
    data = mujoco.MjData(model)
    data.qpos[0], data.qvel[0] = start
    position = np.full(command.size, np.nan)
    with _warnings(mujoco) as told:
        for i in range(command.size):
            position[i] = data.qpos[0]
            data.ctrl[0], data.qfrc_applied[0] = command[i], -load[i]
            for _ in range(substeps):
                mujoco.mj_step(model, data)
            if told and _is_unstable(mujoco, data):  # it would go on from its initial state
                break
    return position


_LIGHT = '<inertial pos="0 0 0" mass="0.001" diaginertia="1e-6 1e-6 1e-6"/>'


def _inertial(pendulum: Link | None) -> str:
    """MJCF of the link: at q = zero it hangs along -z, about the axis y."""
    if pendulum is None:
        return '<inertial pos="0 0 0" mass="0.001" diaginertia="1e-09 1e-09 1e-09"/>'
    if pendulum.gravity_moment <= 0.0:
        i = pendulum.inertia
        return f'<inertial pos="0 0 0" mass="1" diaginertia="{i:.12g} {i:.12g} {i:.12g}"/>'
    arm = 0.5 * pendulum.inertia * GRAVITY / pendulum.gravity_moment
    mass = pendulum.gravity_moment / (GRAVITY * arm)
    own = pendulum.inertia - mass * arm**2
    x, z = arm * math.sin(pendulum.zero), -arm * math.cos(pendulum.zero)
    return f'<inertial pos="{x:.12g} 0 {z:.12g}" mass="{mass:.12g}" diaginertia="{own:.12g} {own:.12g} {own:.12g}"/>'


@contextmanager
def _warnings(mujoco: Any) -> Iterator[list[str]]:
    """MuJoCo's warnings in the block as a list; without it MuJoCo writes MUJOCO_LOG.TXT into the working directory."""
    told: list[str] = []
    before = mujoco.get_mju_user_warning()
    mujoco.set_mju_user_warning(told.append)
    try:
        yield told
    finally:
        mujoco.set_mju_user_warning(before)


def _is_unstable(mujoco: Any, data: Any) -> bool:
    """Whether a position, velocity or acceleration was not finite or huge."""
    kinds = mujoco.mjtWarning
    bad = (kinds.mjWARN_BADQPOS, kinds.mjWARN_BADQVEL, kinds.mjWARN_BADQACC)
    return any(data.warning[int(kind)].number > 0 for kind in bad)


def _mujoco() -> Any:
    os.environ.setdefault("MUJOCO_GL", "disable")  # nothing is drawn, so no display and no OpenGL are needed
    try:
        import mujoco  # type: ignore[import-untyped]
    except (ImportError, OSError):
        raise ParamsError("running the export needs MuJoCo: pip install 'drake-tc[mujoco]'") from None
    return mujoco
