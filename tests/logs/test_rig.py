"""The rig file: what it may say, what comes back after a round trip, and what it refuses."""

import numpy as np
import pytest
import yaml
from numpy.testing import assert_allclose

from drake_tc.errors import RigError
from drake_tc.logs.loads import Pendulum, UnknownLoad, unknown_form
from drake_tc.logs.rig import load_rig, parse_rig, rig_document, save_rig
from drake_tc.logs.units import parse_unit, scale_of

BASE = {"joint": "knee", "drive": "position_servo"}
CURRENT = {"joint": "knee", "drive": "current"}
LEG = {"joints": ["hip", "knee"], "drive": "current"}


def test_viscous_and_coulomb_are_always_declared():
    assert dict(parse_rig(BASE).declared["knee"]) == {"viscous": None, "coulomb": None}


@pytest.mark.parametrize(
    ("declared", "expected"),
    [
        ({"rotor_inertia": 0.31}, {"rotor_inertia": 0.31}),
        ({"knee": {"rotor_inertia": 0.31}}, {"rotor_inertia": 0.31}),
        (["stribeck"], {"stribeck": None}),
        ({"stribeck": None, "viscous": 2}, {"stribeck": None, "viscous": 2.0}),
        ({"stribeck": {"velocity": 0.1}}, {"stribeck": None, "stribeck.velocity": 0.1}),
    ],
)
def test_declared_in_every_form(declared, expected):
    rig = parse_rig({**BASE, "declared": declared})
    assert dict(rig.declared["knee"]) == {"viscous": None, "coulomb": None} | expected
    assert rig.known("knee", "rotor_inertia") == expected.get("rotor_inertia", 0.0)


def test_several_joints_each_with_its_own(tmp_path):
    document = {
        "joints": ["hip", "knee"],
        "drive": {"hip": "current", "knee": "voltage"},
        "load": {"hip": {"pendulum": {"mass": 2.0, "length": 0.5}}},
        "declared": {"knee": {"rotor_inertia": 0.1}},
        "saturation": {"hip": 5},
    }
    (tmp_path / "rig.yaml").write_text(yaml.safe_dump(document))
    rig = load_rig(tmp_path / "rig.yaml")
    assert rig.required_columns("hip") == ("hip/position", "hip/current")
    assert rig.required_columns("knee") == ("knee/position", "knee/voltage", "knee/torque")
    assert rig.load["hip"] == Pendulum(2.0, 0.5, 0.5)
    again = load_rig(save_rig(rig, tmp_path / "again.yaml", comment="two joints"))
    for name in ("joints", "drive", "load", "declared", "columns", "units", "enabled", "valid", "saturation"):
        assert getattr(again, name) == getattr(rig, name), name


@pytest.mark.parametrize(
    "more",
    [
        {"declared": {"stribeck": {"velocity": 0.1}, "rotor_inertia": 0.2}, "load": "unknown", "enabled": "on"},
        {"columns": {"position": "q"}, "units": {"knee/position": "deg", "torque": "-N*m", "current": 0.01}},
        {"load": {"pendulum": {"mass": 1, "length": 0.2, "inertia": 0.05, "zero": 0.3}}, "saturation": 0.2},
        {"valid": ["free", "tip height > -0.02", "mode == 3"]},
    ],
)
def test_round_trip(tmp_path, more):
    rig = parse_rig({**BASE, **more})
    again = load_rig(save_rig(rig, tmp_path / "rig.yaml"))
    for name in ("joints", "drive", "load", "declared", "columns", "units", "enabled", "valid", "saturation"):
        assert getattr(again, name) == getattr(rig, name), name


def test_a_last_part_names_the_columns_of_all_joints():
    rig = parse_rig({**LEG, "columns": {"current": "<joint>/effort", "position": "q_<joint>", "hip/current": "amps"}})
    assert dict(rig.columns) == {
        "hip/current": "amps",
        "knee/current": "knee/effort",
        "hip/position": "q_hip",
        "knee/position": "q_knee",
    }
    with pytest.raises(RigError, match=r"'current' is that of 2 joints: .*`hip/current: effort`.*<joint>/effort"):
        parse_rig({**LEG, "columns": {"current": "effort"}})
    assert dict(parse_rig({**BASE, "columns": {"position": "<joint>_deg"}}).columns) == {"knee/position": "knee_deg"}


def test_a_joint_without_a_value_has_the_default():
    rig = parse_rig({**LEG, "load": {"hip": None, "knee": "unknown"}, "declared": {"hip": ["stribeck"], "knee": None}})
    assert rig.load == {"hip": "torque", "knee": "unknown"}
    assert "stribeck" in rig.declared["hip"] and "stribeck" not in rig.declared["knee"]


def test_a_joint_may_be_called_pendulum():
    pendulum = {"pendulum": {"mass": 1.0, "length": 1.0}}
    for load in (pendulum, {"pendulum": pendulum}):
        rig = parse_rig({"joint": "pendulum", "drive": "current", "load": load})
        assert rig.load["pendulum"] == Pendulum(1.0, 1.0)


@pytest.mark.parametrize(
    ("document", "says"),
    [
        ([1], "expected a mapping"),
        ({"drive": "current"}, "'joint'"),
        ({**BASE, "joints": ["a"]}, "one of the keys"),
        ({"joints": ["a", "a"], "drive": "current"}, "twice"),
        ({"joint": ["a"], "drive": "current"}, "expected one name"),
        ({"joint": "knee"}, "drive is missing; expected one of position_servo, current, voltage"),
        ({**BASE, "drive": "position_servos"}, "did you mean 'position_servo'"),
        ({"joints": ["a", "b"], "drive": {"a": "current"}}, "no entry for joint 'b'"),
        ({**BASE, "unit": {}}, "did you mean 'units'"),
        ({**BASE, "units": {"position": "A"}}, "possible: rad"),
        ({**BASE, "units": {"position": 0}}, "scale factor"),
        ({**BASE, "units": {"ankle/position": "deg"}}, "'ankle/position' is not a canonical column"),
        ({**BASE, "columns": {"positon": "q"}}, "did you mean 'knee/position'"),
        ({**BASE, "columns": {"position": [1]}}, "column's name"),
        ({**BASE, "load": "spring"}, "pendulum"),
        ({**BASE, "load": {"pendulum": {"mass": 1.0}}}, "length is missing"),
        ({**BASE, "load": {"pendulum": {"mass": -1.0, "length": 1.0}}}, "mass: expected a positive number, got -1.0"),
        (
            {**BASE, "load": {"pendulum": {"mass": "1 kg", "length": 1.0}}},
            "expected a positive number, got '1 kg'",
        ),
        ({**BASE, "load": {"pendulum": {"mass": 1, "lenght": 1}}}, "did you mean 'length'"),
        ({**BASE, "declared": ["stribek"]}, "did you mean 'stribeck'"),
        ({**BASE, "declared": {"rotor_inertia": "big"}}, "rotor_inertia: expected a number"),
        ({**BASE, "declared": {"rotor_inertia": -1}}, ">= 0"),
        ({**BASE, "declared": {"stribek": 1}}, "declared: unknown effect 'stribek'; did you mean 'stribeck'?"),
        ({**BASE, "declared": ["link_mass"]}, "a cause of the whole robot and cannot be declared"),
        ({**LEG, "declared": {"hip": ["stribeck"], "kneee": {}}}, "not a joint of this rig; did you mean 'knee'"),
        ({**LEG, "load": {"hip": "torque", "kne": "torque"}}, "load: 'kne' is not a joint of this rig; did you"),
        ({**LEG, "drive": {"hip": "current", "knne": "current"}}, "no entry for joint 'knee'; entries"),
        ({**LEG, "drive": {"hip": "current", "knee": "volts"}}, "drive.knee: expected one of position_servo"),
        ({**LEG, "load": {"hip": {"pendulum": {"mass": 1.0}}}}, "load.hip.pendulum: length is missing"),
        ({**BASE, "load": {"robot": "estimat"}}, "load.robot: expected one of estimate, inverse_dynamics"),
        ({**BASE, "unit": {}}, "`drake-tc schema rig --page` explains every key"),
        ({**BASE, "enabled": 3}, "name of a column"),
        ({**BASE, "valid": 3}, "a column compared with a number, got 3"),
        ({**BASE, "valid": "height > low"}, "and a number, got 'height > low'"),
        ({**BASE, "saturation": -1}, "positive number"),
        ({**BASE, "saturation": {"hip": 1}}, "'hip' is not a joint"),
        ({**CURRENT, "torque_constant": 0.07}, "torque_constant: expected gear_ratio for knee too"),
        ({**CURRENT, "gear_ratio": 100.0}, "gear_ratio: expected torque_constant for knee too"),
        (
            {**CURRENT, "torque_constant": 0.07, "gear_ratio": 100.0, "drive_gain": 0.1},
            "torque_constant: knee has drive_gain too, and both state the drive's gain",
        ),
        ({**BASE, "torque_constant": 0.07, "gear_ratio": 9.0}, "it belongs to `drive: current`; the drive of knee is"),
        ({**CURRENT, "proportional_gain": 20.0}, "proportional_gain: it belongs to `drive: position_servo`"),
        ({**BASE, "derivative_gain": 1.5}, "derivative_gain: expected proportional_gain or drive_gain for knee too"),
        ({**BASE, "proportional_gain": 9.0, "drive_gain": 0.1}, "proportional_gain: knee has drive_gain too"),
        ({**BASE, "proportional_gain": -9.0}, "proportional_gain: expected a positive number, got -9.0"),
        ({**LEG, "gear_ratio": {"hipp": 9.0}}, "'hipp' is not a joint of this rig; did you mean 'hip'?"),
    ],
)
def test_refusals(tmp_path, document, says):
    path = tmp_path / "rig.yaml"
    path.write_text(yaml.safe_dump(document))
    with pytest.raises(RigError) as caught:
        load_rig(path)
    assert says in str(caught.value)
    assert str(path) in str(caught.value)
    assert "\n" not in str(caught.value)


def test_missing_and_broken_files(tmp_path):
    with pytest.raises(RigError, match="no such rig file"):
        load_rig(tmp_path / "absent.yaml")
    (tmp_path / "rig.yaml").write_text("joint: [knee\ndrive: x")
    with pytest.raises(RigError, match=r"not valid YAML at line 2"):
        load_rig(tmp_path / "rig.yaml")


@pytest.mark.parametrize(
    ("name", "unit", "value", "si"),
    [
        ("knee/position", "deg", 180.0, np.pi),
        ("knee/velocity", "rpm", 60.0, 2 * np.pi),
        ("knee/torque", "-mN*m", 500.0, -0.5),
        ("knee/current", "mA", 1500.0, 1.5),
        ("knee/temperature", "degF", 212.0, 100.0),
        ("knee/temperature", "K", 300.0, 26.85),
        ("knee/temperature", "-degF", 212.0, -100.0),
        ("imu_base/accel_x", "g", 1.0, 9.80665),
        ("time", "ms", 20.0, 0.02),
        ("knee/current", -0.0065, 100.0, -0.65),
    ],
)
def test_units_to_si(name, unit, value, si):
    scale = parse_unit(name, unit)
    assert_allclose(scale.factor * value + scale.offset, si, rtol=1e-12)  # exact but for rounding


def test_unit_of_the_position_speaks_for_the_command_but_a_sign_does_not():
    assert scale_of("knee/position_command", {"position": "deg"}).factor == pytest.approx(np.pi / 180)
    assert scale_of("knee/position_command", {"position": "-deg"}).factor == 1.0
    assert scale_of("knee/position_command", {"position": "deg", "position_command": "rad"}).factor == 1.0


def test_pendulum_torque_is_the_gradient_of_its_energy():
    pendulum, h = Pendulum(mass=0.7, length=0.3, zero=0.2), 1e-6
    q = np.linspace(-3, 3, 11)
    height = lambda angle: -0.3 * np.cos(angle - 0.2)  # noqa: E731
    slope = 0.7 * 9.81 * (height(q + h) - height(q - h)) / (2 * h)
    assert_allclose(pendulum.torque(q, np.zeros(11)), slope, rtol=0, atol=1e-8)  # central difference, O(h^2)
    assert_allclose(pendulum.torque(np.array([0.2]), np.ones(1)), 0.7 * 0.09, rtol=1e-12)


def test_a_motors_constants_give_the_drive_gain():
    rig = parse_rig({**CURRENT, "torque_constant": 0.07, "gear_ratio": 100.0})
    assert_allclose(rig.drive_gain["knee"], 1.0 / 7.0, rtol=1e-12)  # 7 N m at the joint for 1 A
    mixed = parse_rig(
        {**LEG, "torque_constant": {"knee": 0.1}, "gear_ratio": {"knee": 50.0}, "drive_gain": {"hip": 0.3}}
    )
    assert mixed.drive_gain == {"hip": 0.3, "knee": 1.0 / 5.0}


def test_a_servos_gains_give_the_drive_gain_and_its_damping():
    rig = parse_rig({**BASE, "proportional_gain": 20.0, "derivative_gain": 1.5})
    assert rig.drive_gain == {"knee": 0.05} and rig.derivative_gain == {"knee": 1.5}
    assert parse_rig(rig_document(rig)) == rig


def test_a_torque_drive_reads_its_own_column():
    rig = parse_rig({"joint": "knee", "drive": "torque", "units": {"torque_command": "mN*m"}})
    assert rig.command_column("knee") == "knee/torque_command" and not rig.drive_gain


@pytest.mark.parametrize(
    ("written", "load", "form"),
    [
        ("unknown", "unknown", "pendulum"),
        ({"unknown": "pendulum"}, "unknown", "pendulum"),
        ({"unknown": "smooth"}, UnknownLoad("smooth"), "smooth"),
        ({"knee": {"unknown": "smooth"}}, UnknownLoad("smooth"), "smooth"),
        ("torque", "torque", None),
    ],
)
def test_the_forms_are_read_and_written_back(written, load, form):
    rig = parse_rig({**CURRENT, "load": written}, "rig.yaml")
    assert rig.load["knee"] == load and unknown_form(rig.load["knee"]) == form
    assert parse_rig(rig_document(rig)) == rig


@pytest.mark.parametrize("value", ["smoth", None, 3, ["smooth"], {"smooth": 4}])
def test_another_form_is_refused_in_one_line(value):
    with pytest.raises(RigError, match=r"^rig\.yaml: load.unknown: expected one of pendulum, smooth, got ") as refused:
        parse_rig({**CURRENT, "load": {"unknown": value}}, "rig.yaml")
    assert "\n" not in str(refused.value)
    if value == "smoth":
        assert "did you mean 'smooth'?" in str(refused.value)


@pytest.mark.parametrize(
    ("entry", "place"),
    [
        ({"load": {"pendulum": {"mass": 1e300, "length": 1e300}}}, "load.pendulum.mass"),
        ({"sensors": {"torque_noise": 1e300}}, "sensors.torque_noise"),
        ({"sensors": {"encoder_step": "1e300 deg"}}, "sensors.encoder_step"),
        ({"drive_gain": 1e-320}, "drive_gain"),
        ({"proportional_gain": 1e-300}, "proportional_gain"),
        ({"declared": {"rotor_inertia": 10**400}}, "declared.rotor_inertia"),
    ],
)
def test_numbers_whose_powers_and_quotients_overflow_are_refused(entry, place):
    with pytest.raises(RigError, match=rf"rig: {place}: expected 0 or a number of size 1e-20 to 1e\+12, got"):
        parse_rig({**BASE, "load": "torque", **entry})
