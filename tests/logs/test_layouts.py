"""One run, written in every layout and unit that logs come in, is the same run once `inspect` has named its columns."""

import json
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pandas as pd
import pyarrow
import pyarrow.feather
import pyarrow.parquet
import pytest
import scipy.io
from few_effects import experiments_fit
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from numpy.testing import assert_allclose

from drake_tc.diagnosis.problem.prepared import prepare_joint
from drake_tc.errors import LogError
from drake_tc.experiments.check.run import check_rig
from drake_tc.logs.files.readers import read_table
from drake_tc.logs.inspection import inspect_log, trial
from drake_tc.logs.prepare import load_run
from drake_tc.logs.rig import load_rig, parse_rig, save_rig

TIME = np.arange(2000) / 250.0
POSITION = 0.9 * np.sin(1.7 * TIME) + 0.3 * np.sin(4.1 * TIME + 1.0)
RATE = 1.53 * np.cos(1.7 * TIME) + 1.23 * np.cos(4.1 * TIME + 1.0)
NOISE = np.random.default_rng(5)
TORQUE = 1.5 * np.sin(POSITION) + 0.02 * NOISE.normal(size=TIME.size)
CURRENT = 0.8 * TORQUE + 0.3 * np.tanh(20.0 * RATE) + 0.4 * RATE + 0.01 * NOISE.normal(size=TIME.size)
COMMAND = POSITION + 0.2 * CURRENT
"""A pendulum behind a gear with friction, [s], [rad], [rad/s], [N m], [A]."""
SIGNALS = {
    "position": POSITION,
    "motor_position": POSITION,
    "position_command": COMMAND,
    "velocity": RATE,
    "torque": TORQUE,
    "current": CURRENT,
}
DEG = 180.0 / np.pi


def table(**names: str) -> pd.DataFrame:
    """The signals by names of columns, after the time."""
    return pd.DataFrame({names.pop("time", "time"): TIME} | {name: SIGNALS[key] for key, name in names.items()})


def csv(factors: list[float], separator: str = ",", **names: str) -> Callable[[Path], Path]:
    """A writer of a plain table: the signals by names of columns, and their factors."""

    def write(path: Path) -> Path:
        (table(**names) * factors).to_csv(path, index=False, sep=separator)
        return path

    return write


def comments(path: Path) -> Path:
    text = table(position="position", current="current", torque="torque").to_csv(index=False)
    lines = text.splitlines()
    lines.insert(40, "# the load was changed here")
    path.write_text("\n".join(["# bench 3, gear 6", "# kt = 0.11", "", *lines]) + "\n")
    return path


def savetxt(path: Path) -> Path:
    own = table(position="position", current="current", torque="torque")
    np.savetxt(path, own.to_numpy(), delimiter=",", header=",".join(own.columns))
    return path


def pairs(path: Path) -> Path:
    own = table(position="pos [deg]", current="current [mA]", torque="torque [Nm]")
    values = np.column_stack([column for name in own.columns[1:] for column in (TIME, own[name])])
    values *= [1, DEG, 1, 1e3, 1, 1]
    rows = "\n".join(",".join(f"{value:.9f}" for value in row) for row in values)
    path.write_text("pos [deg],,current [mA],,torque [Nm],\nX,Y,X,Y,X,Y\n" + rows + "\n")
    return path


def named_times(path: Path) -> Path:
    """Each channel beside a time that has a name of its own, as data loggers export several inputs."""
    own = {"pos [deg]": POSITION * DEG, "cur [mA]": CURRENT * 1e3, "load [Nm]": TORQUE}
    columns = {
        name: values for key, series in own.items() for name, values in ((f"t_{key[:3]} [s]", TIME), (key, series))
    }
    pd.DataFrame(columns).to_csv(path, index=False)
    return path


def units_of_pairs(path: Path) -> Path:
    """Names over the times, and below them a line of units in place of X and Y."""
    values = np.column_stack([TIME, POSITION * DEG, TIME, CURRENT * 1e3, TIME, TORQUE])
    rows = "\n".join(",".join(f"{value:.9f}" for value in row) for row in values)
    path.write_text("Position,,Current,,Torque,\nsec,deg,sec,mA,sec,Nm\n" + rows + "\n")
    return path


def device_above(path: Path) -> Path:
    own = table(time="Time [s]", position="Actual Position [deg]", current="Actual Current [mA]", torque="Load [Nm]")
    text = (own * [1.0, DEG, 1e3, 1.0]).to_csv(index=False)
    path.write_text(f"Device,EPOS\nDate,2026-01-02\n\n{text}")
    return path


def decimal_commas(path: Path) -> Path:
    own = table(time="Zeit", position="Winkel", current="Strom", torque="Drehmoment") * [1.0, DEG, 1e3, 1.0]
    names, rows = own.to_csv(index=False, sep=";", decimal=",").split("\n", 1)
    path.write_text(f"{names}\ns;°;mA;Nm\n{rows}", encoding="utf-8")
    return path


def clocks(path: Path) -> Path:
    """Each channel after a time of its own; the last two are sampled later than the first."""
    late = TIME + 0.001
    own = {name: np.interp(late, TIME, SIGNALS[name]) for name in ("current", "torque")}
    rows = zip(TIME, POSITION, late, own["current"], late, own["torque"], strict=True)
    text = "\n".join(",".join(f"{value:.9f}" for value in row) for row in rows)
    path.write_text("Time [s],position,Time [s],current,Time [s],torque\n" + text + "\n")
    return path


def units_below(path: Path) -> Path:
    own = table(position="angle", current="iq", torque="torque") * [1e3, DEG, 1e3, 1.0]
    names, rows = own.to_csv(index=False).split("\n", 1)
    path.write_text(f"{names}\nms,deg,mA,Nm\n{rows}")
    return path


def dotted(path: Path) -> Path:
    own = table(time="t", position="knee_joint.pos", velocity="knee_joint.vel", current="knee_joint.cur")
    own.assign(**{"knee_joint.tau": TORQUE, "torque_enable": 1}).to_csv(path, index=False)
    return path


def arrays(path: Path) -> Path:
    two = {"q": POSITION, "qd": RATE, "q_cmd": COMMAND, "tau_measured": TORQUE, "ee_pos": POSITION}
    matrices = {name: np.column_stack([values, values]) for name, values in two.items()}
    if path.suffix == ".npz":
        np.savez(path, time=TIME, **matrices)
    else:
        scipy.io.savemat(path, {"time": TIME[:, None], **matrices})
    return path


def columns_of_json(path: Path) -> Path:
    own = {name: SIGNALS[key].tolist() for name, key in (("pos", "position"), ("cmd", "position_command"))}
    path.write_text(json.dumps({"hz": 250, "knee": own | {"torque": TORQUE.tolist()}}))
    return path


def records_of_json(path: Path) -> Path:
    own = table(position="knee/position", position_command="knee/position_command", torque="knee/torque")
    path.write_text(json.dumps({"mass": 0.5, "entries": own.to_dict("records")}))
    return path


def lerobot(path: Path, version: int) -> Path:
    names = {"names": ["knee"]}
    keys = {"observation.state": POSITION * DEG, "action": COMMAND * DEG, "observation.torque": TORQUE}
    (path / "meta").mkdir(parents=True)
    (path / "meta" / "info.json").write_text(json.dumps({"fps": 250, "features": dict.fromkeys(keys, names)}))
    frames = pd.DataFrame({name: list(values[:, None]) for name, values in keys.items()})
    frames = frames.assign(timestamp=TIME, episode_index=0)
    place = path / "data" / "chunk-000" / ("episode_000000.parquet" if version == 2 else "file-000.parquet")
    place.parent.mkdir(parents=True)
    frames.to_parquet(place)
    return path


def goal_topic(path: Path) -> Path:
    """As PlotJuggler writes the topics of a bag."""
    own = table(time="__time", position="/joint_states/knee/position", velocity="/joint_states/knee/velocity")
    own["/sensors/knee/torque"] = TORQUE
    own["/goal_position/knee/position"] = COMMAND
    own["/controller_state/error/knee/position"] = COMMAND - POSITION
    own.assign(__time=own["__time"] + 1.7e9).to_csv(path, index=False, float_format="%.9f")
    return path


def one_row_a_joint(path: Path) -> Path:
    own = table(position="position", position_command="goal", torque="torque")
    both = pd.concat([own.assign(joint="knee"), (-own.assign(time=-TIME)).assign(joint="hip")])
    both.sort_values("time", kind="stable").to_csv(path, index=False)
    return path


def index_of_times(path: Path) -> Path:
    own = table(position="position", position_command="position_command", torque="torque").drop(columns="time")
    own.columns = pd.MultiIndex.from_product([["knee"], own.columns])
    own.set_axis(pd.to_timedelta(TIME, unit="s")).to_parquet(path)
    return path


def structured(path: Path) -> Path:
    own = table(time="t", position="q", position_command="q_des", torque="tau")
    np.save(path, own.to_records(index=False))
    return path


def unit_before_the_joint(path: Path) -> Path:
    own = {"q_meas_deg": POSITION * DEG, "q_ref_deg": COMMAND * DEG, "tau_mNm": TORQUE * 1e3}
    two = {name: np.stack([values, -values], 1) for name, values in own.items()}
    np.savez(path, ts=TIME * 1e6, **two)
    return path


def time_series(path: Path) -> Path:
    series = {"q": (POSITION * DEG, "deg"), "q_ref": (COMMAND * DEG, "deg"), "tau": (TORQUE, "N*m")}
    fields = {
        name: {"Time": TIME[:, None], "Data": values[:, None], "Name": "", "DataInfo": {"Units": unit}}
        for name, (values, unit) in series.items()
    }
    scipy.io.savemat(path, {"logsout": fields})
    return path


def scope(path: Path) -> Path:
    own = {"knee position": POSITION, "knee position command": COMMAND, "knee torque [Nm]": TORQUE}
    signals = np.zeros(3, dtype=[("values", "O"), ("label", "O"), ("dimensions", "O")])
    for number, (name, values) in enumerate(own.items()):
        signals[number] = (values[:, None], name, 1)
    scipy.io.savemat(path, {"ScopeData": {"time": TIME[:, None], "signals": signals}})
    return path


def messages_of_json(path: Path) -> Path:
    """As a bridge of ROS writes joint states, whose joints are in `name`."""
    rows = zip(TIME + 1e-9, POSITION, RATE, CURRENT, strict=True)
    stamps = ((t, {"sec": 1700000000 + int(t), "nanosec": int((t % 1) * 1e9)}, *rest) for t, *rest in rows)
    lines = [
        {"header": {"stamp": s}, "name": ["hip", "knee"], "position": [q, -q], "velocity": [v, -v], "current": [i, -i]}
        for _, s, q, v, i in stamps
    ]
    path.write_text("\n".join(json.dumps(line) for line in lines))
    return path


def joints_of_json(path: Path) -> Path:
    own = {"position": np.stack([POSITION, -POSITION], 1).tolist(), "torque": np.stack([TORQUE, -TORQUE], 1).tolist()}
    actions = np.stack([COMMAND, -COMMAND], 1).tolist()
    path.write_text(json.dumps({"dt": 0.004, "joint_names": ["knee", "hip"], "sensor_data": own, "actions": actions}))
    return path


def sensor_data(path: Path) -> Path:
    path.write_text(
        json.dumps(
            {
                "hz": 250,
                "data": [{"actions": COMMAND.tolist(), "sensor_data": POSITION.tolist(), "torque": TORQUE.tolist()}],
            }
        )
    )
    return path


def echoed_messages(path: Path) -> Path:
    """As `rostopic echo -p` writes joint states."""
    own = table(time="%time", position="field.position0", current="field.current0", velocity="field.velocity0")
    own["%time"] = np.round(1.7e18 + own["%time"] * 1e9).astype(np.int64)
    for name in ("position", "current", "velocity"):
        own[f"field.{name}1"] = -own[f"field.{name}0"]
    own.assign(**{"field.name0": "knee", "field.name1": "hip"}).to_csv(path, index=False)
    return path


def tuples_in_cells(path: Path) -> Path:
    own = {"position": POSITION, "current": CURRENT, "velocity": RATE}
    cells = {name: [f"({x:.9f}, {-x:.9f})" for x in values] for name, values in own.items()}
    pd.DataFrame({"time": TIME, "name": "['knee', 'hip']", **cells}).to_csv(path, index=False)
    return path


FACTORS = {"time": 1e3, "q": DEG, "q_cmd": DEG, "tau": 1e3}
"""Factors to the units ms, deg, deg and mNm, which no range of values tells."""


def in_odd_units() -> pd.DataFrame:
    return table(position="q", position_command="q_cmd", torque="tau") * list(FACTORS.values())


def units_above(path: Path) -> Path:
    path.write_text("[ms],[deg],[deg],[mNm]\n" + in_odd_units().to_csv(index=False))
    return path


def units_in_a_comment(path: Path) -> Path:
    path.write_text("# bench 7\n# units: ms, deg, deg, mNm\n" + in_odd_units().to_csv(index=False))
    return path


def units_in_comments(path: Path) -> Path:
    path.write_text("# q: deg\n# q_cmd [deg]\n# tau in mNm\n" + in_odd_units().to_csv(index=False))
    return path


def units_in_one_comment(path: Path) -> Path:
    path.write_text("# time[ms] q[deg] q_cmd[deg] tau[mNm]\n" + in_odd_units().to_csv(index=False))
    return path


def units_of_long_rows(path: Path) -> Path:
    own = in_odd_units()
    rows = pd.concat([own.assign(joint="knee"), own.assign(joint="hip")]).sort_values("time", kind="stable")
    path.write_text("# units: ms, deg, deg, mNm, -\n" + rows.to_csv(index=False))
    return path


def units_in_json(path: Path) -> Path:
    units = {"time": "ms", "q": "deg", "q_cmd": "deg", "tau": "mNm"}
    path.write_text(json.dumps({"units": units, **in_odd_units().to_dict("list")}))
    return path


def units_in_npz(path: Path) -> Path:
    own = {name: values.to_numpy() for name, values in in_odd_units().items()}
    np.savez(path, q_unit="deg", q_cmd_unit="deg", tau_unit="mNm", time_unit="ms", **own)
    return path


def units_in_a_struct(path: Path) -> Path:
    own = {name: values.to_numpy() for name, values in in_odd_units().items()}
    scipy.io.savemat(path, own | {"units": {"q": "deg", "q_cmd": "deg", "tau": "mNm"}})
    return path


def units_in_metadata(path: Path) -> Path:
    whole = pyarrow.Table.from_pandas(in_odd_units(), preserve_index=False)
    units = {"time": "ms", "q": "deg", "q_cmd": "deg", "tau": "mNm"}
    schema = pyarrow.schema([field.with_metadata({"unit": units[field.name]}) for field in whole.schema])
    pyarrow.parquet.write_table(whole.cast(schema), path)
    return path


def one_row_a_motor(path: Path) -> Path:
    """Two motors of a bus that answer after each other."""
    own = table(position="pos_deg", current="iq", torque="torque") * [1, DEG, 1, 1]
    rows = pd.concat([own.assign(motor_id=3), (-own).assign(motor_id=7, time=TIME + 0.001)])
    rows.sort_values("time").to_csv(path, index=False)
    return path


def one_row_a_signal(path: Path) -> Path:
    own = table(position="knee/position", current="knee/current", torque="knee/torque")
    own.melt("time", var_name="signal", value_name="value").sort_values("time", kind="stable").to_csv(path, index=False)
    return path


def dates_with_a_comma(path: Path) -> Path:
    """As Python's logging writes them."""
    stamps = pd.to_datetime(1.7e18 + 1e9 * TIME).strftime("%Y-%m-%d %H:%M:%S,%f").str[:-3]
    table(time="t", position="position", position_command="target", torque="torque").assign(t=stamps).rename(
        columns={"t": "asctime"}
    ).to_csv(path, index=False)
    return path


def time_of_day(path: Path) -> Path:
    """Across midnight."""
    stamps = pd.to_datetime(1.7e9 // 86400 * 86400e9 - 5e9 + 1e9 * TIME).strftime("%H:%M:%S.%f")
    own = table(position="position", position_command="target", torque="torque")
    own.assign(time=stamps).to_csv(path, index=False)
    return path


def motor_behind_a_gear(path: Path) -> Path:
    own = table(position="link_encoder_deg", current="motor_current_A", torque="link_torque_Nm") * [1, DEG, 1, 1]
    own.assign(motor_encoder_deg=100.0 * DEG * POSITION).to_csv(path, index=False)
    return path


def structs(path: Path) -> Path:
    state = [{"position": q, "torque": tau} for q, tau in zip(POSITION, TORQUE, strict=True)]
    pd.DataFrame({"time": TIME, "state": state, "command": [{"position": q} for q in COMMAND]}).to_parquet(path)
    return path


def joints_with_names(path: Path) -> Path:
    own = table(position="pos", position_command="target", torque="tau").to_dict("records")
    lines = [
        {"t": row.pop("time"), "joints": [{"name": "knee", **row}, {"name": "hip", **{k: -v for k, v in row.items()}}]}
        for row in own
    ]
    path.write_text("\n".join(map(json.dumps, lines)))
    return path


def odrive(path: Path) -> Path:
    """Two axes; angles in turns."""
    names = {"encoder.pos_estimate": POSITION, "encoder.vel_estimate": RATE, "controller.input_pos": COMMAND}
    own = {name: values / (2.0 * np.pi) for name, values in names.items()} | {"motor.Iq_measured": CURRENT}
    both = [{f"axis{i}.{name}": values for name, values in own.items()} for i in range(2)]
    pd.DataFrame({"time": TIME} | both[0] | both[1] | {"axis0.torque": TORQUE, "axis1.torque": TORQUE}).to_csv(
        path, index=False
    )
    return path


def feather(path: Path) -> Path:
    columns = {"time": (TIME, ""), "position": (DEG * POSITION, "deg"), "current": (1e3 * CURRENT, "mA")}
    columns["torque"] = TORQUE, "N*m"
    fields = [pyarrow.field(name, pyarrow.float64(), metadata={"unit": unit}) for name, (_, unit) in columns.items()]
    whole = pyarrow.table([values for values, _ in columns.values()], schema=pyarrow.schema(fields))
    pyarrow.feather.write_feather(whole, path)
    return path


CSV = (
    *(comments, savetxt, pairs, clocks, named_times, units_of_pairs, device_above, decimal_commas),
    *(units_below, dotted),
)
NAMED = {"position": "position (deg)", "position_command": "position_command (rad)", "torque": "torque (N·mm)"}
"""What the name of the command states goes before the unit of the position."""
SHAFT = {"position": "shaft position [deg]", "velocity": "shaft vel [Hz]", "current": "q-axis [mA]"}
KNEE = {"position": "knee_deg", "position_command": "knee_cmd_deg", "velocity": "knee_rpm", "torque": "knee_Nm"}
ACTUAL = {"position_command": "posDes", "position": "posAct", "velocity": "velAct", "torque": "torAct", "current": "i"}
SERVO = {"position": "Present Position (ID 1)", "position_command": "Goal Position (ID 1)"}
TRACE = {"position": "Lageistwert [°]", "position_command": "Lagesollwert [°]", "torque": "Drehmomentistwert [mNm]"}
LAYOUTS = {write.__name__: (write, "run.csv") for write in CSV} | {
    "two units of angles": (csv([1.0, DEG, 1.0, 1e3], **NAMED), "run.csv"),
    "units in names": (
        csv([1e3, DEG, 1 / (2 * np.pi), 1e3, 1.0], time="time [ms]", **SHAFT, torque="load [Nm]"),
        "run.csv",
    ),
    "units at the end": (csv([1e6, DEG, DEG, 30 / np.pi, 1.0], time="t_us", **KNEE), "run.csv"),
    "actual and desired": (csv([1.0] * 6, time="t", **ACTUAL), "run.csv"),
    "npz": (arrays, "run.npz"),
    "mat": (arrays, "run.mat"),
    "plotjuggler": (goal_topic, "run.csv"),
    "units above": (units_above, "run.csv"),
    "units in a comment": (units_in_a_comment, "run.csv"),
    "units in comments": (units_in_comments, "run.csv"),
    "units in one comment": (units_in_one_comment, "run.csv"),
    "units of long rows": (units_of_long_rows, "run.csv"),
    "units in json": (units_in_json, "run.json"),
    "units in npz": (units_in_npz, "run.npz"),
    "units in a struct": (units_in_a_struct, "run.mat"),
    "units in metadata": (units_in_metadata, "run.parquet"),
    "echoed messages": (echoed_messages, "run.csv"),
    "tuples in cells": (tuples_in_cells, "run.csv"),
    "drive trace": (csv([1e3, DEG, DEG, 1e3], "\t", time="Zeit [ms]", **TRACE), "run.txt"),
    "one row a motor": (one_row_a_motor, "run.csv"),
    "one row a signal": (one_row_a_signal, "run.csv"),
    "dates with a comma": (dates_with_a_comma, "run.csv"),
    "time of day": (time_of_day, "run.csv"),
    "motor behind a gear": (motor_behind_a_gear, "run.csv"),
    "servos by number": (csv([1.0, 1.0, 1.0, 1e3], **SERVO, torque="Torque (ID 1) [mNm]"), "run.csv"),
    "structs": (structs, "run.parquet"),
    "joints with names": (joints_with_names, "run.jsonl"),
    "one row a joint": (one_row_a_joint, "run.csv"),
    "index of times": (index_of_times, "run.parquet"),
    "structured": (structured, "run.npy"),
    "unit before the joint": (unit_before_the_joint, "run.npz"),
    "time series": (time_series, "run.mat"),
    "scope": (scope, "run.mat"),
    "odrive": (odrive, "run.csv"),
    "feather": (feather, "run.feather"),
    "json messages": (messages_of_json, "run.jsonl"),
    "json joints": (joints_of_json, "run.json"),
    "json sensor data": (sensor_data, "run.json"),
    "json columns": (columns_of_json, "run.json"),
    "json records": (records_of_json, "run.json"),
    "lerobot 2": (lambda path: lerobot(path, 2), "run"),
    "lerobot 3": (lambda path: lerobot(path, 3), "run"),
}

CHECKED = "savetxt"
"""The layout whose check is computed, beside the declared model; the others end where its fit begins."""


def same_signals(run, joint: str) -> None:
    """What the run has of the joint is what was written; a channel of another clock is off by its interpolation."""
    assert_allclose(run.time - run.time[0], TIME[: len(run)], rtol=0, atol=1e-6)
    told = {name: values for name, values in run.columns.items() if name.startswith(f"{joint}/")}
    assert f"{joint}/position" in told and len(told) >= 3
    for name, values in told.items():
        expected = SIGNALS[name.rpartition("/")[2]][: len(run)]
        assert_allclose(values[2:-2], expected[2:-2], rtol=0, atol=5e-6, err_msg=name)


def _episodes(kind: str) -> dict[str, np.ndarray]:
    """Three episodes of two joints, of 60, 60 and 40 samples; those of `padded` end with zeros."""
    long = np.stack([POSITION[start : start + 60] for start in (0, 200, 400)])
    time = np.arange(60) * 0.004
    both = {"position": np.stack([long, -long], axis=2), "torque": np.stack([2.0 * long, long], axis=2)}
    if kind == "episodes first":
        return {**both, "time": time, "joint_names": np.array(["hip", "knee"])}
    if kind == "times first":
        return {name: values.swapaxes(0, 1) for name, values in both.items()} | {"time": time}
    if kind == "a rate":
        return {**both, "dt": np.array(0.004)}
    times = np.tile(time, (3, 1))
    times[2, 40:] = 0.0
    return {"time": times, "position": long, "torque": 2.0 * long}


@pytest.mark.parametrize("ending", [".npz", ".mat"])
@pytest.mark.parametrize("kind", ["episodes first", "times first", "a rate", "padded"])
def test_arrays_with_an_axis_of_episodes_are_episodes(tmp_path, kind, ending):
    path, arrays = tmp_path / f"run{ending}", _episodes(kind)
    np.savez(path, **arrays) if ending == ".npz" else scipy.io.savemat(path, arrays)
    table = read_table(path)
    position = next(name for name in table.columns if "position" in name)
    sizes = [60, 60, 40 if kind == "padded" else 60]
    assert len(table) == sum(sizes) and "3 episodes (0 to 2)" in table.attrs["notes"][0]
    assert np.count_nonzero(np.diff(table["time"]) > 0.9) == 2 and np.all(np.diff(table["time"]) > 0.0)
    for number, (start, size) in enumerate(zip((0, 200, 400), sizes, strict=True)):
        alone = read_table(tmp_path / f"{path.name}#{number}")
        assert_allclose(alone[position], POSITION[start : start + size], rtol=1e-15)
        assert_allclose(alone["time"], np.arange(size) * 0.004, atol=1e-12)
    with pytest.raises(LogError, match="no episode 3; episodes here: 0 to 2"):
        read_table(tmp_path / f"{path.name}#3")


def test_episodes_without_times_say_what_is_missing(tmp_path):
    arrays = _episodes("a rate")
    np.savez(tmp_path / "run.npz", position=arrays["position"], torque=arrays["torque"])
    with pytest.raises(LogError, match=r"3 episodes without times; expected an array of times, or a single number"):
        read_table(tmp_path / "run.npz")


def test_vectors_that_are_no_episodes_stay_as_they_are(tmp_path):
    pictures = np.zeros((TIME.size, 4, 5))  # rows of an image beside the samples
    np.savez(tmp_path / "run.npz", time=TIME, position=POSITION, torque=TORQUE, picture=pictures)
    assert list(read_table(tmp_path / "run.npz").columns) == ["time", "position", "torque"]


@pytest.mark.parametrize("layout", LAYOUTS)
def test_every_layout_goes_from_inspect_to_check(tmp_path, monkeypatch, layout):
    write, name = LAYOUTS[layout]
    path = write(tmp_path / name)
    found = inspect_log(path)
    assert trial(found) == "" and len(found.rig.get("joints", [""])) <= 2, found.notes
    rig = save_rig(parse_rig(dict(found.rig)), tmp_path / "rig.yaml")
    run = load_run(path, load_rig(rig))
    joint = found.rig.get("joint") or found.rig["joints"][0]
    if layout == "clocks":
        assert_allclose(run.columns[f"{joint}/position"], POSITION, rtol=0, atol=1e-8)
        assert np.std(run.columns[f"{joint}/current"][1:] - CURRENT[1:]) < 0.02
    else:
        same_signals(run, joint)
    if layout == CHECKED:
        experiments_fit(monkeypatch)
        assert all(each.refusal == "" for each in check_rig(rig, [path]).joints.values())
    else:
        read = load_rig(rig)
        assert all(prepare_joint([run], [], read, each).train.samples.rows.size > 500 for each in read.joints)


UNITS = {
    "position": {"rad": 1.0, "deg": DEG, "°": DEG, "mrad": 1e3, "turns": 0.5 / np.pi},
    "velocity": {"rad/s": 1.0, "deg/s": DEG, "rpm": 30.0 / np.pi, "Hz": 0.5 / np.pi, "rev/s": 0.5 / np.pi},
    "current": {"A": 1.0, "mA": 1e3},
    "torque": {"Nm": 1.0, "N·m": 1.0, "mNm": 1e3, "N*mm": 1e3, "kgf*cm": 10.1971621, "lbf*in": 8.85074579},
}
NAMES = {
    "position": ["position", "q", "elbow angle", "pos_act", "actPos"],
    "velocity": ["velocity", "speed", "shaft vel", "qd"],
    "current": ["current", "i", "motor current", "q-axis", "iq_meas"],
    "torque": ["torque", "tau", "load", "torAct", "sensor"],
}
SECONDS = {"s": 1.0, "ms": 1e3, "us": 1e6}


@settings(deadline=None, max_examples=30, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(
    data=st.data(), time_unit=st.sampled_from(sorted(SECONDS)), below=st.booleans(), separator=st.sampled_from(",;\t")
)
def test_stated_units_survive_whatever_the_names(tmp_path, data, time_unit, below, separator):
    columns, units, factors = ["time"], [time_unit], [SECONDS[time_unit]]
    for key in UNITS:
        columns.append(data.draw(st.sampled_from(NAMES[key])))
        units.append(data.draw(st.sampled_from(sorted(UNITS[key]))))
        factors.append(UNITS[key][units[-1]])
    values = np.column_stack([TIME, *(SIGNALS[key] for key in UNITS)])[:1000] * factors
    if below:  # words alone tell the quantity here
        columns = [
            name if name in ("time", *UNITS) else key for name, key in zip(columns, ("time", *UNITS), strict=True)
        ]
        names, second = columns, [units]
    else:
        names, second = [f"{name} [{unit}]" for name, unit in zip(columns, units, strict=True)], []
    lines = [names, *second, *[[f"{value:.12g}" for value in row] for row in values]]
    path = tmp_path / "run.csv"
    path.write_text("\n".join(separator.join(line) for line in lines) + "\n")
    found = inspect_log(path)
    assert found.rig["drive"] == "current", found.columns
    run = load_run(path, parse_rig(dict(found.rig)))
    same_signals(run, found.rig["joint"])


@pytest.mark.parametrize("ending", [".npz", ".mat"])
def test_arrays_with_the_joints_first_and_matrices_beside(tmp_path, ending):
    path = tmp_path / f"run{ending}"
    own = {"t": TIME, "q": np.stack([POSITION, -POSITION]), "q_cmd": np.stack([COMMAND, -COMMAND]), "K": np.eye(3)}
    np.savez(path, **own) if ending == ".npz" else scipy.io.savemat(path, own)
    found = inspect_log(path)
    assert trial(found) == "" and found.rig["joints"] == ["joint_0", "joint_1"]
    assert any("were left out: K (3, 3)" in note for note in found.notes)
    run = load_run(path, parse_rig(dict(found.rig)))
    assert_allclose(run.columns["joint_1/position"], -POSITION, rtol=0, atol=1e-12)


def test_names_of_joints_beside_arrays_name_their_columns(tmp_path):
    own = {"t": TIME, "q_meas": np.stack([POSITION, -POSITION], 1), "q_cmd": np.stack([COMMAND, -COMMAND], 1)}
    path = tmp_path / "run.npz"
    np.savez(path, joint_names=np.array(["hip", "knee"]), ee_pos=own["q_meas"], gear=50.0, units="rad", **own)
    found = inspect_log(path)
    assert found.rig["joints"] == ["hip", "knee"] and trial(found) == ""
    assert "Single values are no columns: gear = 50.0, units = 'rad'." in found.notes
    run = load_run(path, parse_rig(dict(found.rig)))
    assert_allclose(run.columns["knee/position_command"], -COMMAND, rtol=0, atol=1e-12)


def test_fields_of_a_structured_array_are_columns(tmp_path):
    rows = np.zeros(TIME.size, dtype=[("t", "f8"), ("q", "f8"), ("q_ref", "f8")])
    rows["t"], rows["q"], rows["q_ref"] = TIME, POSITION, COMMAND
    np.savez(tmp_path / "run.npz", log=rows)
    found = inspect_log(tmp_path / "run.npz")
    run = load_run(tmp_path / "run.npz", parse_rig(dict(found.rig)))
    assert_allclose(run.columns["joint/position"], POSITION, rtol=0, atol=1e-12)


def test_a_joint_of_the_rig_finds_its_columns_behind_a_dot(tmp_path):
    path = dotted(tmp_path / "run.csv")
    rig = {"joint": "knee_joint", "drive": "current", "columns": {"time": "t"}}
    run = load_run(path, parse_rig(rig))
    assert_allclose(run.columns["knee_joint/current"], CURRENT, rtol=0, atol=1e-9)
    same_signals(run, "knee_joint")


@pytest.mark.parametrize("columns", ["time [s],position [rad],loop [s],current [A]", "t [s],t_sys [s],q [rad],i [A]"])
def test_a_second_time_makes_no_pairs(tmp_path, columns):
    """A duration beside the clock, and two clocks of all rows."""
    second = 1e-3 + 1e-5 * NOISE.normal(size=TIME.size) if "loop" in columns else TIME + 5.0
    rows = (TIME, POSITION, second, CURRENT) if "loop" in columns else (TIME, second, POSITION, CURRENT)
    path = tmp_path / "run.csv"
    pd.DataFrame(dict(zip(columns.split(","), rows, strict=True))).to_csv(path, index=False)
    found = inspect_log(path)
    assert not any("its own time column" in note for note in found.notes)
    same = load_run(path, parse_rig(dict(found.rig))).columns["joint/current"]
    assert_allclose(same, CURRENT, rtol=0, atol=1e-9)


def test_counts_in_brackets_are_no_joint_and_no_degrees(tmp_path):
    path = tmp_path / "run.csv"
    counts = POSITION * 4096 / (2.0 * np.pi)
    for values in (counts, np.round(counts)):
        pd.DataFrame({"time": TIME, "Position [inc]": values, "Current [mA]": CURRENT * 1e3}).to_csv(path, index=False)
        found = next(each for each in inspect_log(path).columns if each.name == "Position [inc]")
        assert found.canonical == "joint/position" and found.unit != "deg"


def test_a_number_of_units_is_no_guess(tmp_path):
    """Tenths of a degree in radians would be a motion of many turns, and in degrees one of ten times the range."""
    path = tmp_path / "run.csv"
    own = table(position="Position [0.1 deg]", position_command="Setpoint [0.1 deg]", torque="Torque [Nm]")
    (own * [1, 10 * DEG, 10 * DEG, 1]).to_csv(path, index=False)
    found = inspect_log(path)
    assert "states the unit '0.1 deg'" in trial(found) and found.rig["joint"] == "joint"
    rig = dict(found.rig) | {"units": {"position": 0.1 / DEG, "position_command": 0.1 / DEG}}
    same_signals(load_run(path, parse_rig(rig)), "joint")


def test_a_motor_that_is_not_divided_by_its_gear_is_refused_with_the_factor(tmp_path):
    path = motor_behind_a_gear(tmp_path / "run.csv")
    rig = dict(inspect_log(path).rig)
    rig["units"] = {"position": "deg"}
    with pytest.raises(LogError, match=r"moves 100 times as far as link/position.*motor_position: 0\.000174533"):
        load_run(path, parse_rig(rig))


def test_names_that_change_from_row_to_row_are_told(tmp_path):
    path = echoed_messages(tmp_path / "run.csv")
    own = pd.read_csv(path)
    own.loc[1::2, ["field.name0", "field.name1"]] = ["hip", "knee"]
    own.to_csv(path, index=False)
    assert any("'field.name0' change from row to row" in note for note in inspect_log(path).notes)


def test_phases_with_names_are_one_run(tmp_path):
    own = table(position="position", position_command="goal", torque="torque")
    own.assign(phase_name=np.where(TIME < 6.0, "chirp", "sine")).to_csv(tmp_path / "run.csv", index=False)
    run = load_run(tmp_path / "run.csv", parse_rig(dict(inspect_log(tmp_path / "run.csv").rig)))
    same_signals(run, "joint")
    assert len(run) == TIME.size
