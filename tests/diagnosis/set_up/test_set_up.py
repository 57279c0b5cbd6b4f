"""Gross errors of an arm's set-up are named with what to change, and no effect is named beside them."""

import re
from dataclasses import replace

import numpy as np
import pytest
import yaml
from fitted_arm import JOINTS, NEAR, ROTOR, URDF, record, rig_file, torques
from numpy.testing import assert_allclose
from robot_files import joint_tag, link_tag, urdf, write_robot

from drake_tc.cli.close_loop_command import print_summary
from drake_tc.diagnosis.options import DiagnosisOptions
from drake_tc.diagnosis.run import close_loop
from drake_tc.diagnosis.set_up import balance, changes
from drake_tc.diagnosis.set_up.search import check_set_up
from drake_tc.estimation.robot_loads import robot_logs
from drake_tc.logs.prepare import load_runs
from drake_tc.logs.rig import load_rig
from drake_tc.report.data_files import result_json
from drake_tc.report.html import render
from drake_tc.report.notes import set_up_sentences
from drake_tc.robot.robot import load_robot

TILT = np.radians(35.0)
ELBOW = urdf(
    link_tag("column", (0, 0.01, 0.1), 4, (0.05, 0.05, 0.03)),
    link_tag("upper", (0.02, 0, 0.2), 3, (0.03, 0.03, 0.005)),
    link_tag("fore", (0.03, 0.02, 0.1), 2, (0.02, 0.02, 0.004)),
    link_tag("hand", (0.1, 0.02, 0.05), 1.2, (0.004, 0.01, 0.01)),
    joint_tag("turn", "base", "column", axis=(0, 0, 1)),
    joint_tag("lift", "column", "upper", xyz=(0.1, 0, 0.3), axis=(0, 1, 0)),
    joint_tag("roll", "upper", "fore", xyz=(0, 0, 0.35), axis=(0, 0, 1)),
    joint_tag("bend", "fore", "hand", xyz=(0.05, 0, 0.3), axis=(0, 1, 0)),
)
ROTORS = [{"rotor_inertia": each} for each in ROTOR.tolist()]
ELBOW_JOINTS = ("turn", "lift", "roll", "bend")
ELBOW_RIG = {"drive_gain": dict.fromkeys(ELBOW_JOINTS, 1.0)}


@pytest.fixture(scope="module")
def arm(tmp_path_factory):
    """Folder, training logs and a held-out log of an arm whose files are right."""
    folder = tmp_path_factory.mktemp("arm")
    robot = load_robot(write_robot(folder, URDF, JOINTS))
    logs = [record(folder, robot, f"run_{k}", k) for k in range(3)]
    return folder, logs[:2], logs[2]


def swinging(rng):
    """Time (T,) and motion (q, v, a), (T, 4) each, of four sines a joint."""
    time = np.arange(0.0, 30.0, 0.01)
    omega = 2.0 * np.pi * rng.uniform(0.05, 0.5, (4, 4))
    phase = time[:, None, None] * omega + rng.uniform(0.0, 2.0 * np.pi, (4, 4))
    size = 0.3 / (1.0 + omega)
    parts = size * np.sin(phase), size * omega * np.cos(phase), -size * omega**2 * np.sin(phase)
    return time, *(part.sum(axis=2) for part in parts)


@pytest.fixture(scope="module")
def elbow_arm(tmp_path_factory):
    """The same of an arm whose axes are not parallel, each drive with 1 A for 1 N m."""
    folder = tmp_path_factory.mktemp("elbow_arm")
    robot = load_robot(write_robot(folder, ELBOW, ELBOW_JOINTS))
    logs = []
    for seed in range(3):
        rng = np.random.default_rng(seed)
        time, q, v, a = swinging(rng)
        effort = torques(robot, q, v, a, 0.0) + 0.1 * a + 0.5 * v + 0.4 * np.tanh(v / 1e-3)
        effort += 0.02 * rng.standard_normal(effort.shape)
        columns = {"time": time} | {f"{joint}/position": q[:, i] for i, joint in enumerate(ELBOW_JOINTS)}
        columns |= {f"{joint}/current": effort[:, i] for i, joint in enumerate(ELBOW_JOINTS)}
        logs.append(folder / f"run_{seed}.npz")
        np.savez(logs[-1], **columns)
    return folder, logs[:2], logs[2]


def checked(arm, change=lambda columns: columns, left=1.0, **rig_keys):
    """What the runs say of the set-up once their columns are changed; `left` by the model of the diagnosis."""
    folder, logs, held = arm
    rig = load_rig(rig_file(folder, **rig_keys))
    runs = [replace(run, columns=change(dict(run.columns))) for run in load_runs([*logs, held], rig)]
    robot = robot_logs(rig, runs)
    return check_set_up(robot, robot.links, runs[:2], runs[2:], rig, dict.fromkeys(rig.joints, left))


def scaled(**factors):
    """A change of columns, their slash written as two underscores, by factors."""
    names = {name.replace("__", "/"): factor for name, factor in factors.items()}
    return lambda columns: columns | {name: factor * columns[name] for name, factor in names.items()}


def kinds(check):
    return [(error.kind, error.joints) for error in check.errors]


def test_a_right_set_up_is_not_looked_at(arm):
    assert checked(arm) is None


def test_a_set_up_is_not_questioned_where_the_diagnosis_fits_the_declared_one(arm):
    """It has all rows, and links further from the robot's file than the fast fit."""
    change = scaled(fold__position=-1.0, fold__current=-1.0)
    assert checked(arm, change, left=0.09) is None
    assert checked(arm, change, left=0.11).errors


def test_a_reversed_joint(arm):
    check = checked(arm, scaled(fold__position=-1.0, fold__current=-1.0), drive_gain=None)
    assert kinds(check) == [("joint_reversed", ("fold",))]
    assert check.errors[0].units == {"fold/position": "-rad", "fold/current": "-A"}
    assert "units: {fold/position: -rad, fold/current: -A}" in " ".join(set_up_sentences(check))


@pytest.mark.slow
def test_units_of_the_rig_file_that_reverse_a_joint(arm):
    check = checked(arm, units={"fold/position": "-rad", "fold/current": -1.0})
    assert check.errors[0].units == {"fold/position": "rad", "fold/current": 1.0}


@pytest.mark.parametrize(
    ("column", "kind"),
    [
        ("lift__position", "position_reversed"),
        pytest.param("lift__current", "effort_reversed", marks=pytest.mark.slow),
    ],
)
def test_a_reversed_column(arm, column, kind):
    check = checked(arm, scaled(**{column: -1.0}))
    assert kinds(check) == [(kind, ("lift",))]
    assert [*check.errors[0].units] == [column.replace("__", "/")]


@pytest.mark.slow
def test_an_effort_in_another_unit(arm):
    check = checked(arm, scaled(**{f"{joint}__current": 1000.0 for joint in JOINTS}))
    assert kinds(check) == [("drive_gain", JOINTS)]
    for fitted, declared in check.errors[0].gains.values():
        assert_allclose(fitted / declared, 1000.0, rtol=0.05)
    told = re.search(r"turn, lift and fold is (\d+) times as large", " ".join(set_up_sentences(check)))
    assert_allclose(float(told[1]), 1000.0, rtol=0.01)


@pytest.mark.parametrize(
    ("joint", "factor"),
    [
        ("turn", 1.7),
        ("lift", 0.75),
        ("bend", 1.3),
    ],
)
def test_the_torque_constant_of_one_joint_that_fitted_links_mostly_take_up(elbow_arm, joint, factor):
    """Of each effort less than a tenth is left: no other error of the set-up is tried there."""
    check = checked(elbow_arm, scaled(**{f"{joint}__current": factor}), left=0.09, **ELBOW_RIG)
    assert kinds(check) == [("drive_gain", (joint,))]
    fitted, declared = check.errors[0].gains[joint]
    assert_allclose(fitted / declared, factor, rtol=0.02)


def test_an_effect_of_one_joint_is_no_other_torque_constant(elbow_arm):
    """Friction that depends on the load makes the effort larger in one direction and smaller in the other."""

    def change(columns):
        load, speed = columns["lift/current"], np.gradient(columns["lift/position"])
        return columns | {"lift/current": load + 0.4 * np.abs(load) * np.sign(speed)}

    assert checked(elbow_arm, change, left=0.09, **ELBOW_RIG) is None


def test_the_fit_of_a_free_torque_constant_has_converged(elbow_arm, monkeypatch):
    """The gain and the links' masses scale the same torques."""
    change = scaled(lift__current=1.7)
    few = checked(elbow_arm, change, left=0.09, **ELBOW_RIG)
    monkeypatch.setattr(balance, "ROUNDS", 40)
    many = checked(elbow_arm, change, left=0.09, **ELBOW_RIG)
    assert_allclose(few.errors[0].gains["lift"], many.errors[0].gains["lift"], rtol=2e-3)
    assert_allclose(list(few.after.values()), list(many.after.values()), rtol=0.02)


def test_another_zero(elbow_arm):
    check = checked(elbow_arm, lambda columns: columns | {"lift/position": columns["lift/position"] + 0.6}, **ELBOW_RIG)
    assert kinds(check) == [("zero", ("lift",))]
    assert_allclose(check.errors[0].zero, 0.6, atol=0.01)
    assert "34.3 deg" in set_up_sentences(check)[1]


def test_exchanged_columns(elbow_arm):
    def exchanged(columns):
        names = {"roll": "bend", "bend": "roll"}
        parts = {name: name.partition("/") for name in columns}
        return {f"{names.get(j, j)}{slash}{rest}": columns[name] for name, (j, slash, rest) in parts.items()}

    assert kinds(checked(elbow_arm, exchanged, **ELBOW_RIG)) == [("columns_exchanged", ("roll", "bend"))]


@pytest.mark.slow
def test_exchanged_efforts(elbow_arm):
    def exchanged(columns):
        return columns | {"roll/current": columns["bend/current"], "bend/current": columns["roll/current"]}

    check = checked(elbow_arm, exchanged, **ELBOW_RIG)
    assert kinds(check) == [("efforts_exchanged", ("roll", "bend"))]
    assert "exchange the effort columns" in " ".join(set_up_sentences(check))


def test_a_tilted_base(tmp_path):
    """The angles that are reported are those of the fixed joint that mends the URDF."""
    mount = '<link name="mount"/><joint name="mounting" type="fixed"><parent link="mount"/><child link="base"/>'
    tilted = URDF.replace("</robot>", mount + '<origin rpy="{} {} 0"/></joint></robot>')
    robot = load_robot(write_robot(tmp_path, tilted.format(TILT, 0.2), JOINTS, base="mount"))
    logs = [record(tmp_path, robot, f"run_{k}", k) for k in range(3)]
    write_robot(tmp_path, URDF, JOINTS)
    check = checked((tmp_path, logs[:2], logs[2]))
    assert kinds(check) == [("gravity", ())]
    R_MB = np.array([-np.sin(0.2), np.cos(0.2) * np.sin(TILT), np.cos(0.2) * np.cos(TILT)])
    assert_allclose(check.errors[0].gravity, -R_MB, atol=0.01)
    (shown,) = [line.partition('rpy="')[2].partition('"')[0] for line in set_up_sentences(check) if "rpy" in line]
    assert_allclose([float(x) for x in shown.split()], [TILT, 0.2, 0.0], atol=0.01)


@pytest.mark.slow
def test_a_slope_is_found_although_a_coarse_direction_leads_elsewhere(tmp_path, monkeypatch):
    """Upside down, the arm fits better than as declared, and no descent leads from there to the slope."""
    mount = '<link name="mount"/><joint name="mounting" type="fixed"><parent link="mount"/><child link="base"/>'
    tilted = URDF.replace("</robot>", f'{mount}<origin rpy="{TILT} 0 0"/></joint></robot>')
    robot = load_robot(write_robot(tmp_path, tilted, JOINTS, base="mount"))
    logs = [record(tmp_path, robot, f"run_{k}", k) for k in range(3)]
    write_robot(tmp_path, URDF, JOINTS)
    down = np.array([0.0, -np.sin(TILT), -np.cos(TILT)])
    monkeypatch.setattr(changes, "DIRECTIONS", -down[None])
    check = checked((tmp_path, logs[:2], logs[2]))
    assert kinds(check) == [("gravity", ())]
    assert_allclose(check.errors[0].gravity, down, atol=0.01)


def test_a_gear_that_couples_two_joints(tmp_path, turns=-1.0):
    """The motor of `bend` turns with `bend` and with `roll`, where its rotor and its friction are."""
    robot = load_robot(write_robot(tmp_path, ELBOW, ELBOW_JOINTS))
    logs = []
    for seed in range(3):
        rng = np.random.default_rng(10 + seed)
        time, q, v, a = swinging(rng)
        load = torques(robot, q, v, a, 0.0)
        load[:, 2] -= turns * load[:, 3]  # power balance of the motors
        v, a = (np.column_stack([x[:, :3], x[:, 3] + turns * x[:, 2]]) for x in (v, a))
        effort = load + 0.1 * a + 0.5 * v + 0.4 * np.tanh(v / 1e-3) + 0.02 * rng.standard_normal(load.shape)
        columns = {"time": time} | {f"{joint}/position": q[:, i] for i, joint in enumerate(ELBOW_JOINTS)}
        columns |= {f"{joint}/current": effort[:, i] for i, joint in enumerate(ELBOW_JOINTS)}
        logs.append(tmp_path / f"run_{seed}.npz")
        np.savez(logs[-1], **columns)
    arm = tmp_path, logs[:2], logs[2]
    check = checked(arm, **ELBOW_RIG)
    assert kinds(check) == [("coupled", ("bend", "roll"))]
    assert_allclose(check.errors[0].turns, turns, atol=0.01)
    (shown,) = [line.split("`")[1] for line in set_up_sentences(check) if "coupled: " in line]
    assert checked(arm, **yaml.safe_load(shown), **ELBOW_RIG) is None


@pytest.mark.slow
def test_no_gear_is_tried_that_leaves_a_motion_without_motor(elbow_arm):
    """A declared coupling by 1 and one of -1 the other way round would make two motors turn alike."""
    turned = scaled(lift__position=-1.0, lift__current=-1.0)
    check = checked(elbow_arm, turned, coupled={"bend": {"roll": 1.0}}, **ELBOW_RIG)
    assert check is not None


@pytest.mark.slow
def test_one_joint_that_is_wrong_among_many_that_fit_well_in_the_diagnosis(elbow_arm):
    """The diagnosis has all rows and fits the other joints better than the fast fit, with either set-up."""
    folder, logs, held = elbow_arm
    rig = load_rig(rig_file(folder, **ELBOW_RIG))
    change = scaled(bend__current=-1.0)
    runs = [replace(run, columns=change(dict(run.columns))) for run in load_runs([*logs, held], rig)]
    robot = robot_logs(rig, runs)
    left = dict.fromkeys(ELBOW_JOINTS, 1e-4) | {"bend": 1.0}
    check = check_set_up(robot, robot.links, runs[:2], runs[2:], rig, left)
    assert kinds(check) == [("effort_reversed", ("bend",))]


@pytest.mark.slow
def test_friction_of_a_joint_is_no_error_of_the_set_up(arm):
    """A large asymmetric friction: most of the effort is left, and neither gain nor mounting takes it."""
    v = {joint: lambda columns, joint=joint: np.gradient(columns[f"{joint}/position"]) for joint in JOINTS}

    def change(columns):
        asymmetric = 0.15 * 8.0 * (v["fold"](columns) > 0.0) * np.abs(np.sin(9.0 * columns["fold/position"]))
        return columns | {"fold/current": columns["fold/current"] + asymmetric}

    check = checked(arm, change)
    assert check is not None
    assert check.errors == ()
    assert "None of them explains it" in set_up_sentences(check)[0]


def test_links_without_inertia_tell_no_drive_gain(arm, tmp_path):
    """The fitted gain of such a joint would be as large as rounding makes it."""
    _, logs, held = arm
    without = URDF.replace(link_tag("fore", (0.15, 0.01, 0), 1.2, (0.002, 0.012, 0.012)), '<link name="fore"/>')
    assert without != URDF
    write_robot(tmp_path, without, JOINTS)
    check = checked((tmp_path, logs, held), scaled(lift__position=-1.0, lift__current=-1.0), drive_gain=None)
    assert check is None or "drive_gain" not in [error.kind for error in check.errors]


def test_no_effect_is_named_beside_an_error_of_the_set_up(arm, tmp_path, capsys):
    folder, logs, held = arm
    turned = []
    for log in (*logs, held):
        columns = {name: values[: values.size // 2] for name, values in np.load(log).items()}
        turned.append(tmp_path / log.name)
        np.savez(turned[-1], **scaled(fold__position=-1.0, fold__current=-1.0)(columns))
    result = close_loop(rig_file(folder), turned[:2], turned[2:], NEAR)
    assert [each.id for joint in result.joints.values() for each in joint.effects] == []
    assert result.shared == ()
    assert [joint.next_experiment for joint in result.joints.values()] == [None] * len(JOINTS)
    assert result.verdict == "unexplained_structure"
    document = result_json(result)["set_up"]
    assert [error["kind"] for error in document["errors"]] == ["joint_reversed"]
    assert document["left"]["fold"]["after"] < 0.2 * document["left"]["fold"]["before"]
    page = render(result)
    assert "change the rig file to <code>units: {fold/position: -rad, fold/current: -A}</code>" in page
    assert page.count("No effects were looked for, because the set-up of the robot is wrong.") == len(JOINTS)
    assert page.count("Wrong set-up") == 1 + 2 * len(JOINTS)
    assert "No missing effect found" not in page
    assert "What is left" not in page
    print_summary(result, tmp_path)
    printed = capsys.readouterr().out
    assert [line for line in printed.splitlines() if line.startswith("fold:")] == ["fold: Wrong set-up"]


@pytest.mark.slow
def test_links_that_are_taken_as_known_are_no_reason_to_trust_the_set_up(tmp_path):
    """A base that stands on a slope of 8 deg: a link's centre of mass was named, far from where it is."""
    slope = np.radians(8.0)
    mount = '<link name="mount"/><joint name="mounting" type="fixed"><parent link="mount"/><child link="base"/>'
    tilted = URDF.replace("</robot>", f'{mount}<origin rpy="0 {slope} 0"/></joint></robot>')
    robot = load_robot(write_robot(tmp_path, tilted, JOINTS, base="mount"))
    logs = [record(tmp_path, robot, f"run_{k}", k) for k in range(3)]
    rig = {"load": {"robot": "inverse_dynamics"}, "declared": dict(zip(JOINTS, ROTORS, strict=True))}
    right = close_loop(rig_file(tmp_path, **rig), logs[:2], logs[2:], DiagnosisOptions(assess_residual=False))
    assert right.set_up is None
    write_robot(tmp_path, URDF, JOINTS)
    result = close_loop(rig_file(tmp_path, **rig), logs[:2], logs[2:], DiagnosisOptions(assess_residual=False))
    assert kinds(result.set_up) == [("gravity", ())]
    assert_allclose(result.set_up.errors[0].gravity, [np.sin(slope), 0.0, -np.cos(slope)], atol=0.01)
    assert result.shared == () and [joint.effects for joint in result.joints.values()] == [()] * len(JOINTS)
    assert all(joint.set_up_wrong for joint in result.joints.values())
