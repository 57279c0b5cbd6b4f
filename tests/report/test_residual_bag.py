"""residuals.mcap, read back by rosbags and, where it is installed, by the MCAP project's own reader."""

import numpy as np
import pytest

from drake_tc.diagnosis.result.rig_result import CloseLoopResult
from drake_tc.errors import LogError
from drake_tc.report.data_files import FIELDS, require_rosbags, save_residuals

rosbags = pytest.importorskip("rosbags.highlevel")


def result_of(joints):
    return CloseLoopResult(joints, "effects_found", 1.0, ("slow.csv", "wide.csv"), ("fast.csv",), "rig.yaml")


@pytest.fixture(scope="module")
def bag(joint, tmp_path_factory):
    path = tmp_path_factory.mktemp("bag") / "residuals.mcap"
    save_residuals(result_of({"knee": joint}), path)
    return path


def topics(path):
    """Topic to its stamps (M,) [s] and fields (M, 7)."""
    found = {}
    with rosbags.AnyReader([path]) as reader:
        for connection, stamp, raw in reader.messages():
            message = reader.deserialize(raw, connection.msgtype)
            assert stamp == message.stamp.sec * 10**9 + message.stamp.nanosec
            row = (1e-9 * stamp, *(getattr(message, name) for name in FIELDS))
            found.setdefault(connection.topic, []).append(row)
    return {topic: np.array(rows) for topic, rows in found.items()}


def test_every_run_and_joint_has_its_topics(bag):
    assert set(topics(bag)) == {f"/{run}/knee/effort" for run in ("slow", "wide", "fast")} | {"/fast/knee/position"}


def test_the_residuals_are_those_of_the_result(bag, joint):
    found = topics(bag)
    for split in (joint.train, joint.heldout):
        for number, run in enumerate(split.samples.runs):
            rows = split.samples.run == number
            table = found[f"/{run}/knee/effort"]
            time = split.samples.signals.time[split.samples.rows][rows]
            np.testing.assert_allclose(table[:, 0], time, atol=1e-9)
            np.testing.assert_array_equal(table[:, 1 + FIELDS.index("residual_before")], split.before[rows])
            np.testing.assert_array_equal(table[:, 1 + FIELDS.index("residual_after")], split.after[rows])
            measured = split.samples.reduce(split.samples.signals.effort)[rows]
            np.testing.assert_array_equal(table[:, 1], measured)
            np.testing.assert_allclose(table[:, 2], measured + split.before[rows], rtol=1e-15)
            assert np.isnan(table[:, 1 + FIELDS.index("refined")]).all()


def test_the_free_run_has_the_errors_of_the_report(bag, joint):
    table = topics(bag)["/fast/knee/position"]
    trace = joint.free_run["fast"]
    np.testing.assert_allclose(table[:, 1], trace["recorded"])
    np.testing.assert_allclose(table[:, 1 + FIELDS.index("residual_after")], trace["after"] - trace["recorded"])


def test_the_file_states_units(bag):
    assert b"unit: A; run: slow; held out: False" in bag.read_bytes()


def test_the_reader_of_the_mcap_project_reads_the_same(bag):
    reader = pytest.importorskip("mcap_ros2.reader", reason="mcap-ros2-support is not installed")
    found = {}
    for each in reader.read_ros2_messages(str(bag)):
        row = (each.log_time_ns * 1e-9, *(getattr(each.ros_msg, name) for name in FIELDS))
        found.setdefault(each.channel.topic, []).append(row)
    expected = topics(bag)
    assert set(found) == set(expected)
    for topic, rows in found.items():
        np.testing.assert_allclose(np.array(rows), expected[topic], rtol=1e-15)


def test_names_that_ros_does_not_take_are_changed_and_stay_apart(joint, tmp_path):
    path = tmp_path / "residuals.mcap"
    both = {"left knee": joint, "left-knee": joint}
    save_residuals(result_of(both), path)
    names = {topic for topic in topics(path) if topic.startswith("/slow")}
    assert names == {"/slow/left_knee/effort", "/slow/left_knee/effort_"}


def test_a_missing_package_is_said_in_one_line(monkeypatch):
    monkeypatch.setattr("drake_tc.report.data_files.find_spec", lambda name: None)
    with pytest.raises(LogError, match=r"needs the package rosbags: pip install 'drake-tc\[bags\]'"):
        require_rosbags()
