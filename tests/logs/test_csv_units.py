"""Units that a CSV file states: in the names of its columns, in other encodings, and in a line below the names."""

import numpy as np
import pandas as pd
import pytest
from numpy.testing import assert_allclose

from drake_tc.errors import LogError
from drake_tc.logs.files.readers import read_table
from drake_tc.logs.inspection import inspect_log, trial
from drake_tc.logs.names import meaning
from drake_tc.logs.prepare import load_run
from drake_tc.logs.rig import parse_rig

from .conftest import bench

TURN = 2.0 * np.pi


@pytest.mark.parametrize(
    ("name", "quantity", "unit"),
    [
        ("Position [°]", "position", "deg"),
        ("Velocity [°/s]", "velocity", "deg/s"),
        ("Speed [1/min]", "velocity", "rpm"),
        ("position_turns", "position", "turn"),
        ("Angle (revolutions)", "position", "rev"),
        ("Torque [N·m]", "torque", "N*m"),
        ("Torque(Nmm)", "torque", "N*mm"),
        ("torque_kgfcm", "torque", "kgf*cm"),
        ("Torque (lb-in)", "torque", "lbf*in"),
        ("Temperature [°C]", "temperature", "degC"),
        ("I / A", "current", "A"),
        ("φ / °", "position", "deg"),
        ("φ_soll / °", "position_command", "deg"),
        ("Sollposition [°]", "position_command", "deg"),
        ("Istposition [°]", "position", "deg"),
        ("Sollstrom [mA]", "current_command", "mA"),
        ("Sollwert Winkel [Grad]", "position_command", "deg"),
        ("Position [inch]", "position", "in"),
        ("T (°C)", "temperature", "degC"),
        ("commanded [rad]", "position_command", "rad"),
        ("actual [rad]", "position", "rad"),
        ("U_dc (V)", "supply_voltage", "V"),
        ("force (lbf)", "torque", "lbf"),
        ("pos_estimate [turns]", "position", "turn"),
        ("Drehzahl [1/min]", "velocity", "rpm"),
        ("I/A", "current", "A"),
        ("tau/mNm", "torque", "mN*m"),
        ("ω/(rad/s)", "velocity", "rad/s"),
        ("positionDeg", "position", "deg"),
        ("torqueMNm", "torque", "mN*m"),
        ("deg_pos", "position", "deg"),
        ("Current (mAmps)", "current", "mA"),
        ("Torque (ft-lbs)", "torque", "lbf*ft"),
        ("torque_millinewtonmeters", "torque", "mN*m"),
        ("Time (sec)", "time", "s"),
        ("time_msec", "time", "ms"),
    ],
)
def test_units_as_spreadsheets_and_data_sheets_write_them(name, quantity, unit):
    told = meaning(name)
    assert told is not None and (told.joint, told.quantity, told.unit) == ("", quantity, unit)


@pytest.mark.parametrize(
    ("name", "joint", "quantity"),
    [
        ("tau_J[3]", "joint_3", "torque"),
        ("tau_J_d[3]", "joint_3", "torque_command"),
        ("control.tau_J_d_3", "joint_3", "torque_command"),
        ("/controller_state/actual/positions.3", "joint_3", "position"),
        ("/arm_controller/controller_state/desired/positions[3]", "arm_3", "position_command"),
        ("hip/dof_pos", "hip", "position"),
        ("q_d3", "joint_3", "position_command"),
        ("pos_des3", "joint_3", "position_command"),
        ("vel_meas3", "joint_3", "velocity"),
        ("tau_J3", "joint_3", "torque"),
        ("tau_J_d3", "joint_3", "torque_command"),
        ("/joint_commands/hip/position", "hip", "position_command"),
        ("/joint_trajectory/hip/position", "hip", "position_command"),
        ("/dynamic_joint_states/hip/position", "hip", "position"),
        ("/knee/velocity/target", "knee", "velocity_command"),
        ("torque.setpoint", "", "torque_command"),
        ("voltage.q", "", "voltage"),
        ("applied_torque_1", "joint_1", "torque_command"),
        ("joint_positions_0", "joint_0", "position"),
        ("jointVelocities[2]", "joint_2", "velocity"),
        ("target_positions_1", "joint_1", "position_command"),
        ("knee_qdes", "knee", "position_command"),
        ("taumeas", "", "torque"),
        ("actpos2", "joint_2", "position"),
        ("Position actual value", "", "position"),
        ("field.position0", "joint_0", "position"),
        ("motor_state[3].tau_est", "motor_3", "torque"),
        ("motor_cmd[3].q", "motor_3", "position_command"),
        ("control_position", "", "position_command"),
        ("q_current", "", "current"),
        ("motor_torque", "", "torque_command"),
        ("obs/joint_pos_0", "joint_0", "position"),
        ("left / position", "left", "position"),
        ("list_position", "list", "position"),
    ],
)
def test_names_of_public_logs(name, joint, quantity):
    told = meaning(name)
    assert told is not None and (told.joint, told.quantity, told.unit) == (joint, quantity, "")


@pytest.mark.parametrize(
    ("name", "quantity", "unit"),
    [
        ("pos_deg_knee", "position", "deg"),
        ("position [deg] knee", "position", "deg"),
        ("cur_mA_knee", "current", "mA"),
        ("vel_rad_s_knee", "velocity", "rad/s"),
        ("knee_pos_deg_cmd", "position_command", "deg"),
        ("kneePosDeg", "position", "deg"),
        ("kneePosDegCmd", "position_command", "deg"),
    ],
)
def test_units_between_other_words(name, quantity, unit):
    told = meaning(name)
    assert told is not None and (told.joint, told.quantity, told.unit) == ("knee", quantity, unit)


@pytest.mark.parametrize("name", ["lb_hip_torque", "turn_angle", "rev_knee_pos", "q/a", "arm/in"])
def test_words_that_may_be_units_are_names_of_joints(name):
    told = meaning(name)
    assert told is None or (told.joint and not told.unit)


@pytest.mark.parametrize(("name", "joint"), [("pos (A)", "A"), ("pos (left/knee)", "left_knee"), ("q_ma", "ma")])
def test_names_of_joints_are_no_units(name, joint):
    told = meaning(name)
    assert told is not None and (told.joint, told.unit, told.unknown_unit) == (joint, "", "")


@pytest.mark.parametrize(
    "name",
    [
        *("bus_current", "dc_bus_current [A]", "phase_a_current", "d_current", "fet_temperature"),
        *("tau_ff", "gravity_torque", "tau_g", "model_torque", "position_offset", "kp_cmd"),
        *("torque_disabled", "torque_mode", "target_reached", "in_position", "goal_index", "profile_velocity"),
    ],
)
def test_names_of_what_is_no_signal_of_a_motor(name):
    assert meaning(name) is None


@pytest.mark.parametrize("unit", ["%", "µNm", "cNm", "counts/s", "raw"])
def test_a_unit_that_no_rig_file_may_name_is_not_taken_for_si(tmp_path, unit):
    table = mine().rename(columns={"torque": f"torque [{unit}]"})
    (tmp_path / "run.csv").write_text(table.to_csv(index=False))
    found = inspect_log(tmp_path / "run.csv")
    (torque,) = [column for column in found.columns if column.canonical == "joint/torque"]
    assert torque.unit == "" and unit.replace("µ", "µ") in torque.why
    assert any("is not clear: state it under `units:`" in note for note in found.notes)
    assert "its name states the unit" in trial(found)


@pytest.mark.parametrize("unit", ["min", "h"])
def test_times_in_other_units_are_refused_until_the_rig_has_their_factor(tmp_path, unit):
    name, seconds = f"time [{unit}]", {"min": 60.0, "h": 3600.0}[unit]
    table = mine().rename(columns={"time": name, "angle": "angle [deg]", "target": "target [deg]"})
    path = tmp_path / "run.csv"
    table.assign(**{name: table[name] / seconds}).to_csv(path, index=False)
    found = inspect_log(path)
    assert f"its name states the unit {unit!r}" in trial(found)
    run = load_run(path, parse_rig({**found.rig, "units": {**found.rig["units"], "time": seconds}}))
    assert run.time[-1] == pytest.approx(bench()["time"].iloc[-1])


def test_of_columns_of_one_meaning_the_plain_one_is_used(tmp_path):
    table = mine()
    table.insert(0, "loop_time", 0.004)
    table.insert(1, "torque_est", 0.0)
    table.to_csv(tmp_path / "run.csv", index=False)
    found = inspect_log(tmp_path / "run.csv")
    assert found.rig["columns"]["joint/torque"] == "torque" and "time" not in found.rig["columns"]
    assert sum("seem to be the same" in note for note in found.notes) == 2


@pytest.mark.parametrize("unit", ["counts", "raw", "%"])
def test_numbers_of_a_register_below_the_names_are_not_taken_for_si(tmp_path, unit):
    (tmp_path / "run.csv").write_text(with_units(f"s,deg,deg,{unit}"))
    found = inspect_log(tmp_path / "run.csv")
    assert "joint/torque" not in found.rig["units"]
    assert f"line 2 of the file states the unit '{unit}'" in trial(found)


@pytest.mark.parametrize(
    ("renamed", "without"),
    [
        ({"torque": "torque_filtered"}, "torque"),
        ({"angle": "leader_angle", "torque": "follower_torque"}, "position"),
        ({"angle": "master_angle", "torque": "slave_torque"}, "position"),
    ],
)
def test_filtered_copies_and_leaders_are_no_measurements_of_the_only_joint(tmp_path, renamed, without):
    mine().rename(columns=renamed).to_csv(tmp_path / "run.csv", index=False)
    found = inspect_log(tmp_path / "run.csv")
    assert any(f"are not used: {next(iter(renamed.values()))!r}. To use one" in note for note in found.notes)
    assert not any(key.endswith(f"/{without}") for key in found.rig.get("columns", {}))


@pytest.mark.parametrize(("on", "off"), [("ON", "OFF"), ("enabled", "disabled"), ("True", "False"), (1, 0)])
def test_a_switch_in_words_is_used(tmp_path, on, off):
    table = bench()
    table["torque_enable"] = np.where(table["time"] > 1.0, on, off)
    table.to_csv(tmp_path / "run.csv", index=False)
    found = inspect_log(tmp_path / "run.csv")
    assert found.rig["columns"]["joint/enabled"] == "torque_enable"
    run = load_run(tmp_path / "run.csv", parse_rig(dict(found.rig)))
    assert np.all(run.segment[run.time <= 1.0] < 0) and np.all(run.segment[run.time > 1.1] >= 0)


@pytest.mark.parametrize("layout", ["# ", "", "aligned"])
def test_cells_between_blanks(tmp_path, layout):
    own = bench().iloc[:, :3].set_axis(["t", "q", "tau"], axis=1)
    if layout == "aligned":
        (tmp_path / "run.txt").write_text(own.to_string(index=False))
    else:
        np.savetxt(tmp_path / "run.txt", own, header="t q tau", comments=layout)
    assert_allclose(read_table(tmp_path / "run.txt")[["t", "q", "tau"]], own, rtol=0, atol=1e-6)


def test_numbers_between_blanks_above_commas_are_a_line_above_the_names(tmp_path):
    (tmp_path / "run.csv").write_text("12 7\n\n" + bench().to_csv(index=False))
    assert list(read_table(tmp_path / "run.csv").columns) == list(bench().columns)


def test_blanks_in_names_between_blanks_are_refused_with_what_to_do(tmp_path):
    np.savetxt(tmp_path / "run.txt", bench().to_numpy()[:, :3], header="t (s) q tau")
    with pytest.raises(
        LogError, match="expected 3 names above 3 numbers, got 4 words; write each name as one word, or"
    ):
        read_table(tmp_path / "run.txt")


@pytest.mark.parametrize(("whole", "rest"), [("secs", "nsecs"), ("header.stamp.sec", "header.stamp.nanosec")])
def test_stamps_of_two_numbers(tmp_path, whole, rest):
    table = mine().drop(columns="time")
    time = 1_700_000_000.25 + bench()["time"]
    table.insert(0, whole, np.floor(time).astype(int))
    table.insert(1, rest, np.round((time % 1.0) * 1e9).astype(int))
    table.to_csv(tmp_path / "run.csv", index=False)
    found = inspect_log(tmp_path / "run.csv")
    run = load_run(tmp_path / "run.csv", parse_rig(dict(found.rig)))
    assert len(run) == len(table) and run.period == pytest.approx(np.median(np.diff(bench()["time"])), rel=1e-6)


def test_parts_of_a_stamp_are_no_time_beside_a_whole_one(tmp_path):
    log = bench()
    parts = {"rosbagTimestamp": 1.7e9 + log["time"], "secs": 1.7e9 + np.floor(log["time"]), "nsecs": log["time"] % 1.0}
    log.drop(columns="time").assign(**parts).to_csv(tmp_path / "run.csv", index=False)
    assert inspect_log(tmp_path / "run.csv").rig["columns"]["time"] == "rosbagTimestamp"


def test_the_header_of_rostopic_stands_in_a_comment(tmp_path):
    table = pd.DataFrame({"%time": bench()["time"] * 1e9, "field.name0": "elbow"})
    table["field.position0"] = bench()["joint/position"]
    table.to_csv(tmp_path / "run.csv", index=False)
    assert list(read_table(tmp_path / "run.csv").columns) == ["time", "elbow/position"]


def mine() -> pd.DataFrame:
    """The bench's log in degrees and N mm."""
    table = bench()
    columns = {"time": table["time"], "angle": table["joint/position"] * 360.0 / TURN}
    columns["target"] = table["joint/position_command"] * 360.0 / TURN
    return pd.DataFrame({**columns, "torque": 1e3 * table["joint/torque"]})


def with_units(units: str) -> str:
    names, rest = mine().to_csv(index=False).split("\n", 1)
    return f"{names}\n{units}\n{rest}"


def test_a_line_of_units_below_the_names_gives_the_rig_file(tmp_path):
    path = tmp_path / "run.csv"
    path.write_text(with_units("s,deg,deg,Nmm"))
    found = inspect_log(path)
    assert found.rig["units"] == {"joint/position": "deg", "joint/position_command": "deg", "joint/torque": "N*mm"}
    assert trial(found) == "" and found.rows == len(bench())
    assert [c.why for c in found.columns if c.name == "angle"] == ["known name 'angle'; line 2 of the file states deg"]
    run = load_run(path, parse_rig(dict(found.rig)))
    plain = tmp_path / "plain.csv"
    bench().to_csv(plain, index=False)
    same = load_run(plain, parse_rig({"joint": "joint", "drive": "position_servo"}))
    for name in ("joint/position", "joint/torque"):
        assert_allclose(run.columns[name], same.columns[name], rtol=1e-12, atol=1e-12)


def test_a_unit_of_the_file_that_the_rig_file_does_not_state_is_refused(tmp_path):
    path = tmp_path / "run.csv"
    path.write_text(with_units("s,deg,deg,Nmm"))
    columns = {"joint/position": "angle", "joint/position_command": "target", "joint/torque": "torque"}
    rig = {"joint": "joint", "drive": "position_servo", "columns": columns}
    for units, name in (({}, "position"), ({"position": "deg"}, "torque")):
        with pytest.raises(LogError, match=rf"joint/{name}\): line 2 of the file states .*units: {{joint/{name}"):
            load_run(path, parse_rig(rig | {"units": units}))
    load_run(path, parse_rig(rig | {"units": {"position": "deg", "torque": 1e-3}}))


@pytest.mark.parametrize(("unit", "told"), [("rad", True), ("deg", False), ("-deg", False), (-0.0174533, False)])
def test_a_unit_of_the_rig_file_that_contradicts_the_log_is_told(tmp_path, unit, told):
    path = tmp_path / "run.csv"
    path.write_text(with_units("s,deg,deg,Nmm"))
    document = {
        "joint": "joint",
        "drive": "torque",
        "load": "unknown",
        "columns": {"joint/position": "angle", "joint/torque_command": "torque"},
        "units": {"joint/position": unit, "joint/torque_command": "N*mm"},
    }
    hints = load_run(path, parse_rig(document)).hints
    assert any("the file states the unit 'deg', and the rig file 'rad'" in hint for hint in hints) == told


def test_rows_below_a_line_of_units_are_named_by_their_lines(tmp_path):
    lines = with_units("s,deg,deg,Nmm").splitlines()
    lines[9] = lines[9].rpartition(",")[0] + ",slipped"
    (tmp_path / "run.csv").write_text("\n".join(lines))
    columns = {"joint/position": "angle", "joint/position_command": "target", "joint/torque": "torque"}
    document = {"joint": "joint", "drive": "position_servo", "columns": columns, "units": {"position": "deg"}}
    with pytest.raises(LogError, match=r"row 8 \(file line 10\) holds 'slipped'"):
        load_run(tmp_path / "run.csv", parse_rig(document))


@pytest.mark.parametrize("second", ["0.0,a,b,c", "x,y,z,w", ",,,"])
def test_other_lines_are_rows(tmp_path, second):
    (tmp_path / "run.csv").write_text(with_units(second))
    assert "units" not in read_table(tmp_path / "run.csv").attrs


@pytest.mark.parametrize("encoding", ["utf-8", "utf-8-sig", "cp1252"])
def test_names_keep_their_degree_sign(tmp_path, encoding):
    text = mine().rename(columns={"angle": "angle [°]", "torque": "torque [N·mm]"}).to_csv(index=False)
    (tmp_path / "run.csv").write_bytes(text.encode(encoding))
    assert list(read_table(tmp_path / "run.csv").columns) == ["time", "angle [°]", "target", "torque [N·mm]"]
    units = inspect_log(tmp_path / "run.csv").rig["units"]
    assert units["joint/position"] == "deg" and units["joint/torque"] == "N*mm"


@pytest.mark.parametrize(("above", "lines"), [("recorder\n", "line 1"), ("Recorder\nMotor;XY\n\n", "lines 1 to 3")])
def test_lines_above_the_names_are_skipped_or_refused_with_their_numbers(tmp_path, above, lines):
    (tmp_path / "run.csv").write_text(above + mine().to_csv(index=False, sep=";"))
    table = read_table(tmp_path / "run.csv")
    assert_allclose(table["angle"], mine()["angle"], rtol=1e-15)
    assert any("above the names" in note and "skipped" in note for note in table.attrs["notes"])
    # no row of numbers alone shows where the names are
    (tmp_path / "run.csv").write_text(above + mine().assign(target="moving").to_csv(index=False, sep=";"))
    with pytest.raises(LogError, match=rf"4 cells: remove {lines}, so that the names come first"):
        read_table(tmp_path / "run.csv")


def test_tabs(tmp_path):
    mine().to_csv(tmp_path / "run.tsv", sep="\t", index=False)
    assert_allclose(read_table(tmp_path / "run.tsv")["angle"], mine()["angle"], rtol=1e-15)


def test_the_only_column_of_dates_is_the_time(tmp_path):
    dates = pd.Timestamp("2026-03-04 10:11:12.5") + pd.to_timedelta(mine()["time"], unit="s")
    mine().assign(time=dates).rename(columns={"time": "date"}).to_csv(tmp_path / "run.csv", index=False)
    found = inspect_log(tmp_path / "run.csv")
    assert found.rig["columns"]["time"] == "date" and found.rate == pytest.approx(1000.0)


def test_a_first_row_without_a_date(tmp_path):
    dates = (pd.Timestamp("2026-03-04") + pd.to_timedelta(mine()["time"], unit="s")).astype("datetime64[ns]")
    dates[0] = pd.NaT
    mine().assign(time=dates).to_parquet(tmp_path / "run.parquet")
    assert inspect_log(tmp_path / "run.parquet").duration == pytest.approx(mine()["time"].iloc[-1] - 1e-3)


def test_a_time_in_words_is_refused_with_what_is_possible(tmp_path):
    texts = [f"10h 11min {12.0 + t:09.6f}" for t in mine()["time"]]
    mine().assign(time=texts).to_csv(tmp_path / "run.csv", index=False)
    document = {"joint": "joint", "drive": "position_servo", "load": "unknown"}
    document["columns"] = {"joint/position": "angle", "joint/position_command": "target"}
    with pytest.raises(LogError, match=r"'time' .* write seconds, or dates as 2026-03-04T10:11:12\.005"):
        load_run(tmp_path / "run.csv", parse_rig(document | {"units": {"position": "deg"}}))
