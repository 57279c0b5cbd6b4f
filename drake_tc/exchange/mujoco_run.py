"""MuJoCo with a joint's terms, as `to_mjcf` writes them, integrated by its own `implicitfast`."""

import os
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from typing import Any

import numpy as np

from drake_tc.actuation.recorded_run import Link
from drake_tc.errors import ParamsError
from drake_tc.exchange.mjcf import STEP, to_mjcf
from drake_tc.exchange.mujoco_versions import installed_mujoco, too_old
from drake_tc.exchange.projection import Projection
from drake_tc.exchange.target_run import PointMass, RunInput
from drake_tc.simulator_files.terms import Terms
from drake_tc.types import FloatArray


def simulate_in_mujoco(terms: Terms, pendulum: Link | None, given: RunInput) -> FloatArray:
    """(T,) position of one joint in MuJoCo [rad]; NaN from where the simulation is unstable.

    Args:
        terms: Of its actuator.
        pendulum: On the joint; None leaves the rotor alone.
        given: What moves it.

    Raises:
        ParamsError: MuJoCo is not installed, is too old for a term, or refuses the model.
    """
    mujoco: Any = require_mujoco()
    if old := too_old_for(terms):
        raise ParamsError(f"{old}; pip install 'drake-tc[mujoco]'")
    text = _bench(terms, given.step).replace(_LIGHT, _inertial(pendulum))
    try:
        model = mujoco.MjModel.from_xml_string(text)
    except ValueError as error:
        raise ParamsError(f"MuJoCo refuses the exported model: {' '.join(str(error).split())}") from None
    data = mujoco.MjData(model)
    data.qpos[0], data.qvel[0] = given.start
    if terms.delay:  # before the run the command was its first one; MuJoCo's own history is 0
        samples = int(model.actuator_history[0, 0])
        mujoco.mj_initCtrlHistory(model, data, 0, None, np.full(samples, given.command[0]))
    position = np.full(given.command.size, np.nan)
    with _warnings(mujoco) as told:
        for i in range(position.size):
            position[i] = data.qpos[0]
            data.ctrl[0], data.qfrc_applied[0] = given.command[i], -given.load[i]
            for _ in range(given.substeps):
                mujoco.mj_step(model, data)
            if told and _is_unstable(mujoco, data):  # it would go on from its initial state
                break
    return position


def too_old_for(terms: Terms) -> str:
    """Why the installed MuJoCo cannot load these terms, as a clause; "" where it can.

    Args:
        terms: Of an actuator.
    """
    return too_old(_bench(terms, STEP), ["joint"], installed=installed_mujoco())


def _bench(terms: Terms, step: float) -> str:
    return to_mjcf([Projection("joint", replace(terms, backlash=0.0), (), None)], step=step)


_LIGHT = '<inertial pos="0 0 0" mass="0.001" diaginertia="1e-6 1e-6 1e-6"/>'


def _inertial(pendulum: Link | None) -> str:
    """MJCF of the link, about the axis y."""
    if pendulum is None:
        return '<inertial pos="0 0 0" mass="0.001" diaginertia="1e-09 1e-09 1e-09"/>'
    link = PointMass.of(pendulum)
    centre, own = (" ".join(f"{value:.12g}" for value in each) for each in (link.centre(), 3 * (link.inertia,)))
    return f'<inertial pos="{centre}" mass="{link.mass:.12g}" diaginertia="{own}"/>'


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


def require_mujoco() -> Any:
    """The module.

    Raises:
        ParamsError: MuJoCo is not installed.
    """
    os.environ.setdefault("MUJOCO_GL", "disable")  # nothing is drawn, so no display and no OpenGL are needed
    try:
        import mujoco  # type: ignore[import-untyped]
    except (ImportError, OSError):
        raise ParamsError("running the export needs MuJoCo: pip install 'drake-tc[mujoco]'") from None
    return mujoco
