"""Drawn MJCF files: read, written and read again they are the same model, and both files move alike in MuJoCo."""

import re
from dataclasses import asdict, replace

import numpy as np
import pytest

from drake_tc.actuation.recorded_run import Link
from drake_tc.errors import ParamsError
from drake_tc.exchange.mjcf import to_mjcf
from drake_tc.exchange.mujoco_run import simulate_in_mujoco, simulate_mjcf
from drake_tc.exchange.projection import Projection
from drake_tc.exchange.target_run import RunInput, WrittenFile
from drake_tc.simulator_files.read import read_joints

from ..simulator_files.drawn_mjcf import drawn_mjcf

pytest.importorskip("mujoco", minversion="3.12")

FILES = 40
H, STEPS = 1e-3, 1500
TIME = np.arange(STEPS) * H
NONE = np.zeros(STEPS)


def read(path):
    """Terms of the joint with the damping of its servo; None where the file has a drive that is not read."""
    joint = read_joints(path, ParamsError)["j"]
    if not joint.driven or any(
        word in str(joint.unused) for word in ("its actuator", "ctrlrange", "several actuators")
    ):
        return None
    terms = joint.with_servo_damping()
    inside = 0.0 if terms.torque_limit is None else terms.derivative_gain
    if joint.terms.drive != "position_servo" and terms.torque_limit is not None:
        inside = joint.terms.derivative_gain
    return replace(terms, derivative_gain=inside, armature=terms.armature)


def moves(simulated):
    return np.all(np.isfinite(simulated)) and np.abs(simulated).max() < 20.0


@pytest.mark.parametrize("seed", range(FILES))
def test_a_drawn_file_comes_back_and_moves_alike(tmp_path, seed):
    path = tmp_path / "drawn.xml"
    text = re.sub(r' frictionloss="[^"]*"', "", drawn_mjcf(seed))  # MuJoCo's own friction creeps, the written one holds
    path.write_text(text, encoding="utf-8")
    terms = read(path)
    if (
        terms is None
        or (terms.lag and terms.integral_rate)
        or (terms.drive != "position_servo" and terms.derivative_gain)
    ):
        pytest.skip("a drive that is not read as a whole")
    projection = Projection("j", terms, (), None)
    written = tmp_path / "written.xml"
    written.write_text(to_mjcf([projection]), encoding="utf-8")
    again = read(written)
    assert asdict(again) == {
        name: pytest.approx(value, rel=1e-8, abs=1e-12) if isinstance(value, float) else value
        for name, value in asdict(terms).items()
    }
    command = (0.3 if terms.drive == "position_servo" else 0.2) * np.sin(6.0 * TIME)
    given = RunInput(command, NONE, (0.0, 0.0), H, substeps=4)
    link = Link(0.01)
    original = simulate_mjcf(WrittenFile(text, "j"), link, given)
    exported = simulate_in_mujoco(terms, link, given)
    if moves(original) and terms.damping > 0.0:  # an undamped servo shows the integrators
        assert np.sqrt(np.mean((original - exported) ** 2)) < 0.01 * np.std(original) + 1e-9
