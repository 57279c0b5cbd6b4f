"""Exports against the packages that read them: run where a package is installed, otherwise by its list of names."""

import importlib
import importlib.metadata
import itertools
from xml.etree import ElementTree

import numpy as np
import pytest

from drake_tc.actuation.model import ActuatorModel, Drive, EffectValue
from drake_tc.effects.library import BUILT_IN
from drake_tc.exchange.actuator_configs import to_isaaclab, to_mjlab_actuators
from drake_tc.exchange.mjcf import to_mjcf, with_torque_constant
from drake_tc.exchange.projection import project, vocabulary

from .released_names import is_installed, wrong_names
from .test_no_silent_loss import EXPRESSIBLE, GAIN, USUAL, parameters

WRITERS = {"mjlab": to_mjlab_actuators, "isaaclab": to_isaaclab}
DRIVES = [("position_servo", None), ("current", None), ("voltage", None), ("voltage", 1.2), ("torque", None)]


def projection(target, drive, constant, keys):
    effects = tuple(EffectValue(key, parameters(key)) for key in keys)
    words = vocabulary(target, drive, constant)
    found = project(ActuatorModel("knee", Drive(drive, GAIN), effects), words)
    return found if constant is None else with_torque_constant(found, constant, words)


def projections(target):
    """Of every drive with each pair of effects that some simulator has."""
    pairs = [(), *itertools.combinations(EXPRESSIBLE, 2)]
    return [
        projection(target, drive, constant, dict.fromkeys((*USUAL, *pair)))
        for drive, constant in DRIVES
        for pair in pairs[:: 1 if constant else 5]
    ]


@pytest.mark.parametrize("target", WRITERS)
def test_configurations_use_names_of_the_released_package(target):
    texts = {WRITERS[target]([each]) for each in projections(target)}
    assert len(texts) > 20
    assert {name for text in texts for name in wrong_names(text, target)} == set()


@pytest.mark.parametrize("target", WRITERS)
def test_the_installed_package_takes_the_configurations(target):
    if not is_installed(target):
        pytest.skip(f"{target} is not installed")
    for text in {WRITERS[target]([each]) for each in projections(target)}:
        exec(compile(text, target, "exec"), {})


def test_the_dc_motor_of_mjlab_has_the_numbers_of_mujoco():
    """lugre: F_C, F_S and v_S of the dry friction with its peak; cogging: size, periods and phase of the ripple."""
    keys = dict.fromkeys((*USUAL, "torque_ripple"))
    effects = tuple(EffectValue(key, parameters(key)) for key in keys)
    peak = EffectValue("stribeck", {"stribeck": 0.5, "stribeck_velocity": 0.2, "stribeck_exponent": 2.0})
    words = vocabulary("mjlab", "voltage", 1.2)
    found = project(ActuatorModel("knee", Drive("voltage", GAIN), (*effects, peak)), words)
    text = to_mjlab_actuators([with_torque_constant(found, 1.2, words)])
    scope = {name: lambda **fields: fields for name in ("BuiltinDcMotorActuatorCfg", "DcMotorPhysicalParams")}
    scope["DcMotorInputMode"] = type("Mode", (), {"VOLTAGE": "voltage"})
    lines = [line for line in text.splitlines() if not line.startswith("from ")]
    exec("\n".join(lines), scope)
    (knee,) = scope["ACTUATORS"]
    np.testing.assert_allclose(knee["lugre"][2:], (3.0, 3.5, 0.2), rtol=1e-9)
    assert knee["frictionloss"] == 0.0
    assert knee["motor_params"] == {"kt": 1.2, "ke": 1.2, "resistance": pytest.approx(1.2 * GAIN)}
    assert knee["viscous_damping"] == pytest.approx(40.0 - 1.2 / GAIN)
    ripple = parameters("torque_ripple")
    size, cycles, phase = knee["cogging"]
    q = np.linspace(0.0, 6.0, 50)
    torque = -ripple["ripple_cosine"] * np.cos(cycles * q) - ripple["ripple_sine"] * np.sin(cycles * q)
    np.testing.assert_allclose(size * np.sin(cycles * q + phase), torque, atol=1e-9)
    assert cycles == ripple["cycles_per_turn"]


@pytest.mark.parametrize("target", ["newton", "playground"])
@pytest.mark.parametrize(("drive", "constant"), DRIVES)
def test_a_file_has_no_term_that_its_reader_refuses_or_drops(target, drive, constant):
    """Newton 1.8.0 and MJX 3.17.0, tried with one file for each term of MuJoCo."""
    for each in BUILT_IN:
        text = to_mjcf([projection(target, drive, constant, dict.fromkeys((*USUAL, each.key)))])
        root = ElementTree.fromstring(text)
        elements = list(root.iter())
        assert all(len(joint.get("damping", "").split()) < 2 for joint in root.iter("joint")), each.key
        assert not any(node.get("delay") or node.get("input") == "none" or node.tag == "pid" for node in elements)
        if target == "newton":
            assert not any(node.get("timeconst") or node.get("dyntype") for node in elements), each.key
        else:
            assert not any(node.tag == "dcmotor" for node in elements), each.key


def installed_version(package, wanted):
    try:
        return importlib.metadata.version(package) == wanted
    except importlib.metadata.PackageNotFoundError:
        return False


@pytest.mark.skipif(not installed_version("newton", "1.8.0"), reason="newton 1.8.0 is not installed")
@pytest.mark.parametrize(("drive", "constant"), DRIVES)
def test_newton_reads_what_mujoco_reads(drive, constant, tmp_path):
    mujoco, newton = pytest.importorskip("mujoco"), importlib.import_module("newton")
    fields = ("dof_armature", "dof_damping", "dof_frictionloss", "dof_solref", "jnt_stiffness", "qpos_spring")
    fields += ("actuator_gainprm", "actuator_biasprm", "actuator_gear", "actuator_forcerange", "actuator_ctrlrange")
    for key in ("viscous", "saturation", "cable_spring", "backlash", "elasticity", "servo_integrator", "current_lag"):
        text = to_mjcf([projection("newton", drive, constant, dict.fromkeys((*USUAL, key)))])
        path = tmp_path / f"{key}.xml"
        path.write_text(text)
        builder = newton.ModelBuilder()
        newton.solvers.SolverMuJoCo.register_custom_attributes(builder)
        builder.add_mjcf(str(path))
        read = newton.solvers.SolverMuJoCo(builder.finalize(device="cpu")).mj_model
        expected = mujoco.MjModel.from_xml_path(str(path))
        for name in fields:
            np.testing.assert_allclose(getattr(read, name), getattr(expected, name), rtol=1e-5, err_msg=f"{key} {name}")
