"""Logs in other units, with holes, with uneven times: refused, bridged or told, never taken as they are."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

from drake_tc.cli.main import run
from drake_tc.errors import LogError, RigError
from drake_tc.estimation.base_log import evaluate_log, read_base_log, timing_notes
from drake_tc.estimation.base_rig import load_base_rig

from .constructed import REAL, Motion, construct
from .test_rig import COLUMNS, as_arrays, canonical, document, npz_rig, written


@pytest.fixture(scope="module")
def made():
    return construct(Motion(duration=2.0, period=1e-2), REAL, seed=31)


def scaled(table, part, factor):
    return table.assign(**{name: factor * table[name] for name in table if part in name})


DEG = 180.0 / np.pi


@pytest.mark.parametrize(
    ("part", "factor", "says"),
    [
        ("time", 1e3, "time: expected a period of .* got 10 s; it looks like ms"),
        ("/position", DEG, "position of .*: expected rad within its limits .*; it looks like degrees"),
        ("/velocity", DEG, r"velocity of .*, got 5\d.* times the position's rate; it looks like deg/s"),
        ("gyro", DEG, "gyro: expected rad/s; gravity turns by 0.02.*; it looks like deg/s"),
        ("accel", 1.0 / 9.81, "accel: expected a median size near 9.81 .* it looks like g"),
        ("accel", 1e3, "accel: .* it looks like mm/s"),
        ("l_knee/position", np.nan, "position of l_knee: expected numbers; a column has none in all 200 rows"),
        ("ft_left_ankle/tz", np.nan, "wrench of left: expected numbers; a column has none"),
    ],
)
def test_another_unit_is_refused_with_its_name(tmp_path, made, part, factor, says):
    rig = load_base_rig(written(tmp_path))
    scaled(canonical(made), part, factor).to_parquet(tmp_path / "run.parquet", index=False)
    with pytest.raises(LogError, match=says) as caught:
        read_base_log(rig, tmp_path / "run.parquet")
    assert "\n" not in str(caught.value)


def test_a_time_without_a_number_names_its_row(tmp_path, made):
    table = canonical(made)
    table.loc[50, "time"] = np.nan
    table.to_parquet(tmp_path / "run.parquet", index=False)
    with pytest.raises(LogError, match="time: expected numbers; row 51 has none"):
        read_base_log(load_base_rig(written(tmp_path)), tmp_path / "run.parquet")


def test_uneven_times_are_told_and_differences_take_the_real_steps(tmp_path, made):
    """Every third row is missing: at the mean period of 15 ms the speeds would be a third off."""
    table = canonical(made)
    assert timing_notes(table["time"].to_numpy()) == ()
    kept = table.loc[table.index % 3 != 0, [name for name in table if not name.endswith("/velocity")]]
    kept.to_parquet(tmp_path / "run.parquet", index=False)
    log, _, period = read_base_log(load_base_rig(written(tmp_path)), tmp_path / "run.parquet")
    assert_allclose(period, 1.5e-2, rtol=0.01)
    steps = np.diff(kept["time"])
    assert_allclose(log.qd[1:] * steps[:, None], np.diff(log.q, axis=0), atol=1e-12)
    assert "time steps of 10 to 20 ms, 132 of 132 off the mean" in timing_notes(log.time)[0]


def test_a_hole_in_the_truth_costs_no_more_than_its_samples(tmp_path, made):
    arrays = as_arrays(made, np.arange(30))
    rpy = (arrays["base_rpy"] + [0.0, 0.0, 3.0] + np.pi) % (2.0 * np.pi) - np.pi  # as a tracker gives it, wrapped
    found = {}
    for name, rows in (("whole", []), ("hole", [50])):
        arrays["base_rpy"] = rpy.copy()
        arrays["base_rpy"][rows, 2] = np.nan
        np.savez(tmp_path / f"{name}.npz", **arrays)
        found[name] = evaluate_log(load_base_rig(npz_rig(tmp_path)), tmp_path / f"{name}.npz")
    whole, hole = (found[name].errors[0] for name in ("whole", "hole"))
    assert (whole.samples[1], hole.samples[1]) == (200, 199)
    sums = whole.angle**2 * 200 - hole.angle**2 * 199  # what the one sample took with it
    assert (sums > -1e-12).all() and (sums < np.radians(1.0) ** 2).all()
    yaw = found["hole"].table()["truth/yaw"]
    assert np.isnan(yaw).sum() == 1
    assert np.nanmax(np.abs(np.diff(yaw))) < 0.5  # no turn is counted


def test_a_truth_of_angles_alone_is_used(tmp_path, made):
    rig, arrays = npz_rig(tmp_path), as_arrays(made, np.arange(30))
    columns = {key: value for key, value in COLUMNS.items() if key != "truth_position"}
    contacts = document()["contacts"]
    for side in contacts:
        contacts[side]["wrench"] = f"{side[0]}f"
    rig = written(tmp_path, columns=columns, contacts=contacts)
    np.savez(tmp_path / "run.npz", **arrays)
    result = evaluate_log(load_base_rig(rig), tmp_path / "run.npz")
    assert np.isfinite(result.errors[0].angle).all()
    assert np.isnan(result.errors[0].position).all()
    rows = {row["name"]: row for row in result.to_json()["rows"]}
    assert rows["estimate/angle_yaw"]["samples"] == 200
    assert rows["estimate/position_x"] == {
        "name": "estimate/position_x", "unit": "m", "value": None, "samples": 0,
    }  # fmt: skip


def test_a_sensor_that_the_robot_lacks_and_complex_numbers_are_refused(tmp_path, made):
    contacts = document()["contacts"]
    contacts["left"]["sensor"] = "toe"
    with pytest.raises(RigError, match=r"contacts.left.sensor: no F/T sensor 'toe' in the robot file; there: right_an"):
        load_base_rig(written(tmp_path, contacts=contacts))
    np.savez(tmp_path / "run.npz", **as_arrays(made, np.arange(30)) | {"acc": made.log.accel + 0j})
    with pytest.raises(LogError, match="accel: expected numbers, got complex128"):
        read_base_log(load_base_rig(npz_rig(tmp_path)), tmp_path / "run.npz")


def test_a_folder_that_cannot_be_written_is_told_before_the_log_is_read(tmp_path, capsys):
    (tmp_path / "plain").write_text("")
    arguments = ["estimate-base", "--rig", str(written(tmp_path)), "--log", str(tmp_path / "none.csv")]
    assert run([*arguments, "--out", str(tmp_path / "plain")]) == 2
    assert "--out" in capsys.readouterr().err


def test_a_result_that_cannot_be_written_is_told_before_the_work(tmp_path, made, capsys):
    canonical(made).iloc[:40].to_parquet(tmp_path / "run.parquet", index=False)
    (tmp_path / "out" / "estimate.csv").mkdir(parents=True)
    arguments = ["--rig", str(written(tmp_path)), "--log", str(tmp_path / "run.parquet"), "--json"]
    assert run(["estimate-base", *arguments, "--out", str(tmp_path / "out")]) == 2
    printed = capsys.readouterr()
    assert printed.out == "" and "estimate.csv: cannot be written: a folder is there" in printed.err
