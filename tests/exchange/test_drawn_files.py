"""Drawn model files: read, written and read again they are the same model, and simulators move them as our own model.

MuJoCo and Drake load the drawn file itself. Our own model is what a rig declares from the file, in its free run.
"""

import re
from collections import defaultdict
from dataclasses import asdict, replace
from functools import cache

import numpy as np
import pytest

from drake_tc.actuation.free_run import simulate
from drake_tc.actuation.model import ActuatorModel, Drive, EffectValue
from drake_tc.actuation.recorded_run import Link, Recording
from drake_tc.effects.library import BUILT_IN, effect
from drake_tc.errors import ParamsError
from drake_tc.exchange.drake_run import simulate_file_in_drake
from drake_tc.exchange.mjcf import to_mjcf
from drake_tc.exchange.mujoco_run import simulate_in_mujoco, simulate_mjcf
from drake_tc.exchange.projection import Projection
from drake_tc.exchange.target_run import RunInput, WrittenFile
from drake_tc.exchange.urdf import to_sdf, to_urdf
from drake_tc.logs.rig import parse_rig
from drake_tc.logs.rig_document.declared import declared_terms
from drake_tc.simulator_files.read import read_joints

from ..simulator_files.drawn_drake import drawn_sdf, drawn_urdf
from ..simulator_files.drawn_mjcf import drawn_mjcf, with_includes

MJCF_FILES, DRAKE_FILES = 200, 50
"""Of each kind: with URDF and SDFormat files 300."""
SHARES, QUICK = 20, 1
"""Tests over which they are spread, and how many of these are not slow."""
NUMBERS = [pytest.param(n, marks=[pytest.mark.slow] if n >= QUICK else []) for n in range(SHARES)]
H, STEPS = 1e-3, 1500
TIME = np.arange(STEPS) * H
NONE = np.zeros(STEPS)
LINK = Link(0.01)
WITHIN = 0.01
"""Largest RMS difference of two motions over the range of the motion."""
LISTED = (
    "its actuator",
    "the actuator",
    "ctrlrange",
    "several actuators",
    "switched off",
    "of its drive",
    "inheritrange",
)
"""Words of what a file has and our model is said not to have, which moves the joint differently."""
KEYS = {each.key for each in BUILT_IN}


def own_model(path, drive):
    """The model that a rig declares from a file, with the damping of a servo as a part of the friction."""
    (found,) = declared_terms(parse_rig({"joint": "j", "drive": drive, "load": "unknown"}), path, ("j",))
    values = defaultdict(dict)
    for name, value in found.declared.items():
        key = {"delay": "delay.command"}.get(name, name)
        if key not in KEYS:
            key, _, parameter = name.rpartition(".")
            values[key][parameter] = value
        elif value is not None:
            values[key][effect(key).parameters[0].name] = value
    if found.derivative_gain:
        values["viscous"]["viscous"] = values["viscous"].get("viscous", 0.0) + found.derivative_gain
    effects = tuple(EffectValue(key, parameters) for key, parameters in values.items() if parameters)
    return ActuatorModel("j", Drive(drive, found.drive_gain or 1.0), effects), found.unused


def own_run(model, command):
    return simulate(model, Recording(TIME, command, 0.0, 0.0, (-20.0, 20.0), None, LINK), H / 8)


def is_alike(one, other):
    """Whether two motions agree; None where one of them runs away or the joint hardly moves."""
    if not np.all(np.isfinite(one)) or np.abs(one).max() > 20.0 or np.ptp(one) < 0.02:
        return None
    return bool(np.sqrt(np.mean((one - other) ** 2)) < WITHIN * np.ptp(one))


def assert_same(again, terms):
    assert asdict(again) == {
        name: pytest.approx(value, rel=1e-8, abs=1e-12) if isinstance(value, float) else value
        for name, value in asdict(terms).items()
    }


def written_terms(joint):
    """Terms of the joint as an export has them: the damping of its servo is a part of the joint's."""
    terms = joint.with_servo_damping()
    inside = 0.0 if terms.torque_limit is None else terms.derivative_gain
    if joint.terms.drive != "position_servo" and terms.torque_limit is not None:
        inside = joint.terms.derivative_gain
    constant = None if terms.torque_constant is None else abs(terms.torque_constant)
    return replace(terms, kp=abs(terms.kp), torque_constant=constant, derivative_gain=inside)


@cache
def share(count, number):
    return range(number * count // SHARES, (number + 1) * count // SHARES)


@pytest.mark.parametrize("number", NUMBERS)
def test_a_drawn_mjcf_file_comes_back_and_moves_as_our_model(tmp_path, number):
    pytest.importorskip("mujoco", minversion="3.12")
    moved = 0
    for seed in share(MJCF_FILES, number):
        path, written = tmp_path / f"{seed}.xml", tmp_path / f"{seed}_written.xml"
        text = drawn_mjcf(seed, more=True)
        path.write_text(text, encoding="utf-8")
        joint = read_joints(path, ParamsError)["j"]
        apart, files = with_includes(text)
        for name, content in (files | {"apart.xml": apart}).items():
            (tmp_path / name).write_text(content, encoding="utf-8")
        assert read_joints(tmp_path / "apart.xml", ParamsError)["j"] == joint, seed
        if not joint.driven:
            assert any("its actuator <" in each for each in joint.unused), seed
            continue
        drive, terms, told = joint.terms.drive, written_terms(joint), str(joint.unused)
        command = (0.3 if drive == "position_servo" else 0.2) * np.sin(6.0 * TIME)
        ours = command if drive == "position_servo" else np.sign(joint.terms.kp) * command
        given = RunInput(command, NONE, (0.0, 0.0), H, substeps=4)
        model, unused = own_model(path, drive)
        assert (joint.terms.kp < 0.0) == ("against the command" in str(unused)), seed
        in_one_file = not (terms.lag and terms.integral_rate)
        in_one_file &= drive == "position_servo" or not terms.derivative_gain
        moves_apart = (terms.backlash or terms.compliance) and not terms.armature
        if in_one_file and not any(word in told for word in LISTED):
            written.write_text(to_mjcf([Projection("j", terms, (), None)]), encoding="utf-8")
            again = written_terms(read_joints(written, ParamsError)["j"])
            assert_same(again, terms)
        if any(word in told for word in LISTED) or not terms.damping or moves_apart:
            continue
        exported = simulate_in_mujoco(terms, LINK, replace(given, command=ours)) if in_one_file else None
        if exported is not None and (alike := is_alike(own_run(model, ours), exported)) is not None:
            assert alike, f"{seed}: our model, and the exported file in MuJoCo"
        # MuJoCo's own dry friction creeps, ours holds; the exported one holds too
        path.write_text(re.sub(r' frictionloss="[^"]*"', "", text), encoding="utf-8")
        original = simulate_mjcf(WrittenFile(path.read_text(encoding="utf-8"), "j"), LINK, given)
        alike = is_alike(original, own_run(own_model(path, drive)[0], ours))
        assert alike in (True, None), f"{seed}: the drawn file in MuJoCo, and our model"
        moved += alike is True
    assert moved >= 2


@pytest.mark.parametrize("number", NUMBERS)
@pytest.mark.parametrize("kind", ["urdf", "sdf"])
def test_a_drawn_file_of_drake_comes_back_and_moves_as_our_model(tmp_path, kind, number):
    draw = {"urdf": drawn_urdf, "sdf": drawn_sdf}[kind]
    for seed in share(DRAKE_FILES, number):
        path, written = tmp_path / f"{seed}.{kind}", tmp_path / f"{seed}_written.{kind}"
        text = draw(seed)
        path.write_text(text, encoding="utf-8")
        joint = read_joints(path, ParamsError)["j"]
        drive, terms = joint.terms.drive, written_terms(joint)
        projection = [Projection("j", terms, (), None)]
        exported = to_urdf(projection, path, drake=True) if kind == "urdf" else to_sdf(projection, path)
        written.write_text(exported, encoding="utf-8")
        again = written_terms(read_joints(written, ParamsError)["j"])
        kept = {} if kind == "sdf" else {"frictionloss": 0.0}  # Drake's joints have none, so it is not written
        assert_same(replace(again, **kept), replace(terms, **kept))
        command = 0.3 * np.sin(6.0 * TIME)
        given = RunInput(command, NONE, (0.0, 0.0), H, substeps=4)
        frictionless = re.sub(r" friction='[^']*'|<friction>.*?</friction>", "", text)
        path.write_text(frictionless, encoding="utf-8")
        model, _ = own_model(path, drive)
        for what in (frictionless, exported):
            simulated = simulate_file_in_drake(WrittenFile(what, "j"), LINK, given)
            assert is_alike(simulated, own_run(model, command)), f"{seed}: Drake, and our model"
