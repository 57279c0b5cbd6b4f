"""Isaac Lab's BAM servo: the drive's law, evaluated with the fields of the file, is the identified model's torque.

The release 3.0.0 of isaaclab has no such servo. Its classes are those of the development branch, commit 0120677.
"""

import numpy as np
import pytest

from drake_tc.actuation.model import ActuatorModel, Drive, EffectValue
from drake_tc.actuation.model_file import save_models
from drake_tc.cli.main import run
from drake_tc.errors import ParamsError
from drake_tc.exchange.actuator_configs import ServoSettings, limited_by_supply, to_isaaclab_bam
from drake_tc.exchange.mjcf import with_torque_constant
from drake_tc.exchange.projection import TARGETS, Loss, project

from .isaaclab_stand_in import actuators

SETTINGS = ServoSettings(supply_voltage=12.0, position_gain=40.0)
VISCOUS = EffectValue("viscous", {"viscous": 0.8})
SERVO = (
    EffectValue("rotor_inertia", {"rotor_inertia": 0.02}),
    VISCOUS,
    EffectValue("coulomb", {"coulomb": 0.3}),
    EffectValue("stribeck", {"stribeck": 0.2, "stribeck_velocity": 0.4, "stribeck_exponent": 1.5}),
    EffectValue("saturation", {"limit": 9.0}),
)


def configured(*effects, name="knee", torque_constant=1.2):
    """The joint's BamActuatorCfg, with its BamMotorCfg under `motor`."""
    projection = project(ActuatorModel(name, Drive("voltage", 2.0), effects), TARGETS["isaaclab-bam"])
    text = to_isaaclab_bam([with_torque_constant(projection, torque_constant, TARGETS["isaaclab-bam"])], SETTINGS)
    return actuators(text)[name], projection


def test_the_torque_of_the_drive_is_that_of_the_model():
    """Isaac Lab: kt/R vin clip(kp_fw error_gain e, max_pwm) - kt^2/R v - friction_viscous v and a friction budget."""
    cfg, projection = configured(*SERVO)
    motor = cfg.motor
    error, v = np.meshgrid(np.linspace(-0.5, 0.5, 41), np.linspace(-10.0, 10.0, 41))  # to vin / kt
    duty = np.clip(cfg.kp_fw * motor.error_gain * error, -motor.max_pwm, motor.max_pwm)
    electric = motor.kt / motor.resistance * (cfg.vin * duty - motor.kt * v)
    electric = np.clip(electric, -cfg.actuator_effort_limit, cfg.actuator_effort_limit)
    found = electric - motor.friction_viscous * v
    np.testing.assert_allclose(
        found, 0.5 * np.clip(40.0 * error, -9.0, 9.0) - 0.8 * v, rtol=0, atol=1e-9
    )  # numbers are written with ten digits
    peak = motor.friction_stribeck * np.exp(-((abs(v) / motor.dtheta_stribeck) ** motor.alpha))
    budget = motor.friction_base + peak
    np.testing.assert_allclose(budget, 0.3 + 0.2 * np.exp(-((abs(v) / 0.4) ** 1.5)), rtol=1e-12)
    assert (motor.model, cfg.armature, motor.max_current) == ("m2", 0.02, 0.0)
    assert projection.losses == () and projection.refit is None
    assert (cfg.stiffness, cfg.damping, cfg.max_delay) == (None, None, 0)


def test_the_model_is_the_smallest_that_has_the_friction():
    assert configured(VISCOUS)[0].motor.model == "m1"
    loaded = EffectValue("load_dependent_friction", {"load_friction": 0.12})
    cfg, projection = configured(VISCOUS, loaded)
    assert (cfg.motor.model, cfg.motor.load_friction_external) == ("m5", 0.12)
    assert [(loss.effect, loss.partly) for loss in projection.losses] == [("load_dependent_friction", True)]


def test_a_limit_beyond_the_supply_is_the_supply():
    cfg, projection = configured(VISCOUS, EffectValue("saturation", {"limit": 15.0}))
    assert cfg.motor.max_pwm == 1.0 and projection.losses == ()
    (lost,) = limited_by_supply(projection, SETTINGS).losses
    assert lost == Loss("saturation", "the supply limits the voltage to 12 V, the model to 15 V", partly=True)
    within = configured(VISCOUS, EffectValue("saturation", {"limit": 9.0}))[1]
    assert limited_by_supply(within, SETTINGS) is within


@pytest.mark.parametrize("key", ["delay.command", "delay.loop"])
def test_play_and_delay_are_told_by_the_names_of_isaac_lab(key):
    """Two forms of play: a class, at commit 0120677, and a field of BamActuatorCfg in another version."""
    play, delay = EffectValue("backlash", {"backlash": 0.02}), EffectValue(key, {"delay": 0.01})
    cfg, projection = configured(VISCOUS, play, delay)
    lost = {loss.effect: loss for loss in projection.losses}
    assert not lost["backlash"].partly and lost[key].partly and cfg.max_delay == 2
    for name in ("passive_NAME_backlash of a BamBacklashActuatorCfg", "backlash_joint_template of BamActuatorCfg"):
        assert name in lost["backlash"].why


def test_a_delay_is_of_whole_physics_steps():
    cfg, projection = configured(VISCOUS, EffectValue("delay.command", {"delay": 0.011}))
    assert (cfg.min_delay, cfg.max_delay) == (2, 2)
    assert all(loss.effect == "delay.command" and loss.partly for loss in projection.losses)
    assert len(projection.losses) == 2  # rounded, and a delay of the position command alone


def test_what_it_cannot_be_made_of_is_refused():
    servo = ActuatorModel("knee", Drive("position_servo", 2e-4), (VISCOUS,))
    with pytest.raises(ParamsError, match="isaaclab-bam: BAM's servo is driven by a voltage"):
        to_isaaclab_bam([project(servo, TARGETS["isaaclab-bam"])], SETTINGS)
    voltage = ActuatorModel("knee", Drive("voltage", 2.0), (VISCOUS,))
    with pytest.raises(ParamsError, match="--torque-constant KT"):
        to_isaaclab_bam([project(voltage, TARGETS["isaaclab-bam"])], SETTINGS)
    for wrong in (0.0, -1.0, float("nan"), float("inf")):
        with pytest.raises(ParamsError, match=r"--supply-voltage: expected a positive number \[V\]"):
            ServoSettings(wrong, 40.0)
        with pytest.raises(ParamsError, match=r"--position-gain: expected a positive number \[V/rad\]"):
            ServoSettings(12.0, wrong)


def test_the_command(tmp_path, capsys):
    path = tmp_path / "model.yaml"
    save_models({"knee": ActuatorModel("knee", Drive("voltage", 2.0), SERVO)}, path)
    call = ["export", str(path), "--to", "isaaclab-bam", "--torque-constant", "1.2"]
    assert run([*call, "--supply-voltage", "12"]) == 2
    assert "expected --supply-voltage and --position-gain" in capsys.readouterr().err
    assert run([*call, "--supply-voltage", "12", "--position-gain", "40"]) == 0
    printed = capsys.readouterr()
    assert "BamMotorCfg(" in printed.out and "Isaac Lab (BAM) expresses all effects of this model." in printed.err
    assert run([*call, "--supply-voltage", "6", "--position-gain", "40"]) == 0
    assert "has saturation of the drive only in part: the supply limits the voltage to 6 V" in capsys.readouterr().err
