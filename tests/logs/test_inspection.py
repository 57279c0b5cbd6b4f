"""Names and ranges of unknown logs are read as an engineer would; what cannot be told is not guessed."""

import json
from types import SimpleNamespace

import numpy as np
import pandas as pd
import pytest
import yaml

from drake_tc.cli.main import run
from drake_tc.logs.inspection import inspect_log, trial
from drake_tc.logs.names import meaning
from drake_tc.logs.prepare import load_run
from drake_tc.logs.rig import load_rig, parse_rig

from .conftest import bench, inspected, write

TIME = np.arange(500) / 100.0


@pytest.mark.parametrize(
    ("name", "joint", "quantity"),
    [
        ("knee/position", "knee", "position"),
        ("shoulder_pan_joint/effort", "shoulder_pan_joint", "torque_command"),
        ("q_FL_hip", "FL_hip", "position"),
        ("q_cmd_FL_hip", "FL_hip", "position_command"),
        ("pos (3)", "joint_3", "position"),
        ("target pos (3)", "joint_3", "position_command"),
        ("q1", "joint_1", "position"),
        ("joint1_vel", "joint1", "velocity"),
        ("observation.state.elbow.pos", "elbow", "position"),
        ("elbowJointTorque", "elbow", "torque"),
        ("actual_q_2", "joint_2", "position"),
        ("target_q_2", "joint_2", "position_command"),
        ("current_des_4", "joint_4", "current_command"),
        ("i_q", "", "current"),
        ("axis0.controller.input_torque", "axis0", "torque_command"),
        ("input_vel", "", "velocity_command"),
        ("Timestamp", "", "time"),
        ("ft_foot/fx", "ft_foot", "fx"),
        ("/joint_states/knee/position", "knee", "position"),
        ("/goal_position/knee/position", "knee", "position_command"),
        ("command/joints/hip/pos", "hip", "position_command"),
        ("joints/hip/measured/tau", "hip", "torque"),
        ("lowcmd/motor_cmd[3]/q", "low/motor_3", "position_command"),
        ("lowstate/motor_state[3]/q", "low/motor_3", "position"),
        ("arm/controller_state/reference/elbow/position", "arm/elbow", "position_command"),
        ("joint/position", "joint", "position"),
    ],
)
def test_names(name, joint, quantity):
    told = meaning(name)
    assert told is not None and told.joint.removeprefix("observation_state_") == joint and told.quantity == quantity


@pytest.mark.parametrize(
    ("name", "joint", "quantity", "unit"),
    [
        ("q_deg", "", "position", "deg"),
        ("knee_q_cmd_deg", "knee", "position_command", "deg"),
        ("knee/position_deg", "knee", "position", "deg"),
        ("Joint Velocity (deg/s)", "", "velocity", "deg/s"),
        ("vel_rad_s", "", "velocity", "rad/s"),
        ("elbow current [A]", "elbow", "current", "A"),
        ("i_mA", "", "current", "mA"),
        ("tau [N m]", "", "torque", "N*m"),
        ("q (3)", "joint_3", "position", ""),
        ("q_ma", "ma", "position", ""),
        ("t_ms", "", "time", "ms"),
        ("z_pos_mm", "z", "position", "mm"),
        ("z_vel [mm/s]", "z", "velocity", "mm/s"),
        ("z_pos_cm", "z", "position", "cm"),
        ("z_force_N", "z", "torque", "N"),
        ("load_cell [N]", "", "torque", "N"),
        ("theta_m", "", "motor_position", ""),
        ("tau_mNm_0", "joint_0", "torque", "mN*m"),
        ("q [deg][2]", "joint_2", "position", "deg"),
    ],
)
def test_units_in_names(name, joint, quantity, unit):
    """A number in brackets and a unit of another quantity belong to the joint."""
    told = meaning(name)
    assert told is not None and (told.joint, told.quantity, told.unit) == (joint, quantity, unit)


def test_a_name_tells_degrees_of_a_motion_that_could_be_in_rad(tmp_path):
    turn = 180.0 / np.pi
    table = renamed(q_meas=turn, q_ref=turn).rename(columns={"q_meas": "q_deg", "q_ref": "q_ref_deg"})
    found = inspected(tmp_path, table.assign(q_deg=table["q_deg"] / 20.0, q_ref_deg=table["q_ref_deg"] / 20.0))
    assert found.rig["units"] == {"joint/position": "deg", "joint/position_command": "deg"}
    assert (
        next(column.why for column in found.columns if column.name == "q_deg") == "known name 'q'; its name states deg"
    )


@pytest.mark.parametrize("name", ["foo", "status", "pi", "mass_kg", "error", "error/knee/position"])
def test_names_that_tell_nothing(name):
    assert meaning(name) is None


def renamed(**units) -> pd.DataFrame:
    """The bench's log as somebody else would have written it."""
    table = bench().drop(columns=["joint/voltage", "joint/temperature", "joint/velocity"])
    table.columns = pd.Index(["timestamp", "q_meas", "q_ref", "tau_meas"])
    for name, factor in units.items():
        table[name] = table[name] * factor
    return table


def test_a_rig_file_that_reads_the_log(tmp_path):
    turn = 180.0 / np.pi
    found = inspected(tmp_path, renamed(timestamp=1e3, q_meas=20.0 * turn, q_ref=20.0 * turn))
    assert found.rate == pytest.approx(1000.0) and found.gaps == 0 and found.rows == 6000
    assert dict(found.rig) == {
        "joint": "joint",
        "drive": "position_servo",
        "load": "torque",
        "columns": {
            "time": "timestamp",
            "joint/position": "q_meas",
            "joint/position_command": "q_ref",
            "joint/torque": "tau_meas",
        },
        "units": {"time": "ms", "joint/position": "deg", "joint/position_command": "deg"},
    }
    assert trial(inspected(tmp_path, renamed(timestamp=1e3))) == ""


@pytest.mark.parametrize(
    ("reach", "unit"), [((1000.0, 1030.0), f"{2 * np.pi / 2048:.10g}"), ((6.0, 7.5), "deg"), ((1.5, 1.6), "rad")]
)
def test_a_position_and_its_command_are_taken_to_have_one_unit(tmp_path, reach, unit):
    """The command spans 2048 counts or more than two turns in rad, the position a little less."""
    position, goal = (np.round(size * np.sin(TIME), 0 if size > 100.0 else 3) for size in reach)
    found = inspected(tmp_path, {"time": TIME, "present_position": position, "goal_position": goal})
    units = {column.canonical: column.unit for column in found.columns}
    assert units["joint/position"] == units["joint/position_command"] == unit


def test_counts_of_an_encoder(tmp_path):
    table = renamed()
    for name in ("q_meas", "q_ref"):
        table[name] = np.round(2048 + table[name] * 4096 / (2 * np.pi))
    found = inspected(tmp_path, table)
    assert found.rig["units"]["joint/position"] == pytest.approx(2 * np.pi / 4096, rel=1e-9)
    (position,) = [column for column in found.columns if column.name == "q_meas"]
    assert "encoder counts, perhaps 4096 a turn" in position.why and position.step == pytest.approx(1.0)
    assert any("The counts per turn of 'q_meas', 'q_ref' are guessed" in note for note in found.notes)


@pytest.mark.parametrize(("moving", "units"), [("ab", ["deg"] * 6), ("a", ["deg"] * 2)])
def test_a_joint_that_moves_little_has_the_unit_of_most_others_or_a_note(tmp_path, moving, units):
    t = np.arange(300) / 100.0
    reach = {joint: 80.0 if joint in moving else 4.0 for joint in "abc"}
    columns = {f"{joint}_{name}": size * np.sin(t) for joint, size in reach.items() for name in GOALS}
    found = inspected(tmp_path, {"time": t, **columns})
    assert list(found.rig["units"].values()) == units
    assert any("State the units under" in note for note in found.notes) == (moving == "a")


def test_columns_called_like_the_joints_are_positions_beside_their_commands(tmp_path):
    t = np.arange(300) / 100.0
    own = {f"{joint}{name}": np.sin(t + at) for joint in ("hip", "J2") for at, name in enumerate(("", "_target"))}
    found = inspected(tmp_path, {"time": t, **own})
    assert found.rig["joints"] == ["hip", "J2"] and found.rig["columns"]["J2/position"] == "J2"


GOALS = ("present_position", "goal_position")


def test_servos_of_one_bus_count_alike(tmp_path):
    t = np.arange(300) / 100.0
    ranges = {"a": 1200, "b": 2600}
    columns = {f"{joint}_{name}": np.round(at + 400.0 * np.sin(t)) for joint, at in ranges.items() for name in GOALS}
    units = inspected(tmp_path, {"time": t, **columns}).rig["units"]
    assert list(units.values()) == pytest.approx([2 * np.pi / 4096] * 4, rel=1e-9)


def test_the_same_quantity_twice_and_joints_without_commands(tmp_path):
    table = renamed().assign(angle=0.1, pos_elbow=np.linspace(0, 1, 6000))
    found = inspected(tmp_path, table)
    told = " ".join(found.notes)
    assert "'q_meas' and 'angle' seem to be the same; 'q_meas' is used" in told
    assert "Joint elbow is left out of the rig file, because it lacks a command" in told
    assert found.rig["joint"] == "joint"


def test_an_effort_beside_the_position_command_is_pointed_out(tmp_path):
    """A rig file for a position servo would leave it unused; what is commanded is for the user to say."""
    table = bench().drop(columns="joint/torque").rename(columns={"joint/voltage": "joint/effort"})
    found = inspected(tmp_path, table)
    assert found.rig["drive"] == "position_servo"
    (told,) = [note for note in found.notes if "also has" in note]
    assert "torque command of joint" in told
    assert "write `drive: torque` and `columns: {joint/torque_command: joint/effort}` in the rig file." in told


def of_a_test_stand() -> pd.DataFrame:
    """The bench's log without a position."""
    made = bench()
    rpm = made["joint/velocity"] * 60.0 / (2.0 * np.pi)
    return pd.DataFrame({"t": made["time"], "rpm": rpm, "u": made["joint/voltage"], "tau": made["joint/torque"]})


def test_a_velocity_stands_for_the_position_of_a_test_stand(tmp_path):
    path = write(of_a_test_stand(), tmp_path / "run.csv")
    found = inspect_log(path)
    assert dict(found.rig) == {
        "joint": "joint",
        "drive": "voltage",
        "load": "torque",
        "columns": {"time": "t", "joint/velocity": "rpm", "joint/voltage": "u", "joint/torque": "tau"},
        "units": {"joint/velocity": "rpm"},
    }
    assert any("its velocity is integrated" in note for note in found.notes) and trial(found) == ""
    read = load_run(path, parse_rig(dict(found.rig)))
    assert read.speed_only == ("joint",)
    turned = bench()["joint/position"]
    assert read.columns["joint/position"] == pytest.approx(turned - turned[0], abs=1e-5)


@pytest.mark.parametrize(("without", "instead"), [("tau", {}), ("u", {"q_ref": 0.1})])
def test_a_velocity_alone_is_not_enough_where_drive_or_load_depend_on_the_position(tmp_path, without, instead):
    table = of_a_test_stand().drop(columns=without).assign(**instead)
    found = inspected(tmp_path, table)
    assert found.rig == {} and any("its velocity is enough only with" in note for note in found.notes)


def test_the_command_writes_the_rig_and_says_what_it_took(invoke_inspect, tmp_path):
    path = write(renamed(), tmp_path / "run.csv")
    rig = tmp_path / "rig.yaml"
    outcome = invoke_inspect(path, "--rig", rig)
    assert outcome.code == 0 and outcome.out.endswith(f"{rig}\n") and "known name 'q_ref'" in outcome.out
    assert load_run(path, load_rig(rig)).notes == ()
    document = json.loads(invoke_inspect(path, "--json").out)
    assert document["rig"] == yaml.safe_load(rig.read_text()) and document["problem"] is None
    refused = invoke_inspect(path, "--rig", path)
    assert refused.code == 2 and "is an input" in refused.err and path.read_text().startswith("timestamp")


def test_a_log_without_joints_lists_its_columns_and_writes_no_rig(invoke_inspect, tmp_path):
    path = write(pd.DataFrame({"t": np.arange(100) * 0.01, "foo": 1.0}), tmp_path / "run.csv")
    outcome = invoke_inspect(path, "--rig", tmp_path / "rig.yaml")
    assert outcome.code == 2 and "foo" in outcome.out and not (tmp_path / "rig.yaml").exists()
    assert "no rig file was written: No joint has both a position and a command" in outcome.err


@pytest.fixture
def invoke_inspect(capsys):
    def call(*arguments):
        code = run(["inspect", *map(str, arguments)])
        captured = capsys.readouterr()
        return SimpleNamespace(code=code, out=captured.out, err=captured.err)

    return call


def test_a_load_cell_that_names_no_joint_belongs_to_the_only_one(tmp_path):
    axis = 0.1 * np.sin(TIME)
    columns = {"t": TIME, "z_pos_mm": 1e3 * axis, "z_cmd_mm": 1e3 * axis + 1.0, "load_cell_N": 40.0 + axis}
    rig = inspected(tmp_path, columns).rig
    assert (rig["joint"], rig["load"]) == ("z", "torque")
    assert rig["columns"]["z/torque"] == "load_cell_N" and rig["units"]["z/torque"] == "N"
    other = inspected(tmp_path, columns | {"x_pos_mm": 1e3 * axis, "x_cmd_mm": 1e3 * axis})
    assert other.rig["load"] == "unknown"


@pytest.mark.parametrize(
    ("names", "units"),
    [
        (("position", "current [A]", "force [N]"), {"position": "m", "torque": "N"}),
        (("position [m]", "current [A]", "force"), {"position": "m", "torque": "N"}),
        (("pos_mm", "cmd", "load_cell"), {"position": "mm", "position_command": "mm", "torque": "N"}),
    ],
)
def test_one_unit_of_length_or_force_tells_those_of_the_other_columns(tmp_path, names, units):
    """A rig file without them would take the joint for one that turns, and 180 mm for degrees."""
    rig = inspected(tmp_path, {"time": TIME, **{name: 180.0 * np.sin(TIME) for name in names}}).rig
    assert rig["units"] == {f"joint/{name}": unit for name, unit in units.items()}
    assert parse_rig(rig).joint_type("joint") == "prismatic"


@pytest.mark.parametrize(
    ("names", "joint", "drive", "load"),
    [
        (("timestamp_ms", "knee_angle_deg", "motor_i", "torque_knee"), "knee", "current", "torque"),
        (("t_us", "q_link", "motor_current", "tau_jts"), "link", "current", "torque"),
        (("time_ms", "q_deg", "speed_rpm", "iq_mA"), "joint", "current", "unknown"),
        (("ts", "pos_mm", "Iq_A", "loadcell_N"), "joint", "current", "torque"),
        (("t", "present_pos", "goal_pos", "vbat_mV"), "joint", "position_servo", "unknown"),
        (("t", "q", "i_cmd", "motor_temp"), "joint", "current", "unknown"),
        (("t", "knee_enc", "u", "v_bat"), "knee", "voltage", "unknown"),
    ],
)
def test_a_log_with_every_quantity_once_is_the_log_of_one_joint(tmp_path, names, joint, drive, load):
    """A single joint's columns name the motor, the sensor or the link, and these are no joints."""
    scale = {"timestamp_ms": 1e3, "t_us": 1e6, "time_ms": 1e3}.get(names[0], 1.0)
    columns = {names[0]: scale * TIME} | {name: np.sin(TIME + k) for k, name in enumerate(names[1:])}
    rig = inspected(tmp_path, columns).rig
    assert (rig["joint"], rig["drive"], rig["load"]) == (joint, drive, load)
    assert {names[0], names[1]} <= set(rig["columns"].values())


def test_names_before_a_slash_are_joints_even_where_every_quantity_is_there_once(tmp_path):
    columns = {"time": TIME, "hip/position": np.sin(TIME), "knee/current": np.cos(TIME)}
    assert inspected(tmp_path, columns).rig == {}


def test_parts_of_a_joint_are_one_joint_unless_two_have_the_same_quantity(tmp_path):
    q, u = np.sin(TIME), np.cos(TIME)
    apart = {"axis/encoder/position": q, "axis/drive/current": u, "other/encoder/position": q, "other/current": -u}
    assert inspected(tmp_path, {"time": TIME, **apart}).rig["joints"] == ["axis", "other"]
    twice = {"axis/encoder/position": q, "axis/motor/position": q, "axis/motor/current": u}
    assert inspected(tmp_path, {"time": TIME, **twice}).rig["joint"] == "axis/motor"
    of_motor = {"axis/motor/position": q, "axis/motor/current": u, "axis/torque": u}
    assert inspected(tmp_path, {"time": TIME, **of_motor}).rig["joint"] == "axis/motor"


def test_turns_of_an_odrive_take_two_of_its_names(tmp_path):
    one = inspected(tmp_path, {"time": TIME, "pos_estimate": np.sin(TIME), "current": np.cos(TIME)})
    assert not any("ODrive" in note for note in one.notes)


def test_a_duty_cycle_is_a_voltage_whose_unit_only_the_user_knows(tmp_path):
    """100 % of an unknown supply voltage is no number of volts."""
    found = inspected(tmp_path, {"t": TIME, "enc_rad": np.sin(TIME), "duty_pct": 60.0 * np.cos(TIME)})
    assert (found.rig["drive"], found.rig["columns"]["joint/voltage"]) == ("voltage", "duty_pct")
    assert any("unit of 'duty_pct' is not clear" in note for note in found.notes)
    assert "0.12 for percent of 12 V" in next(column.why for column in found.columns if column.name == "duty_pct")
