"""Data sets of LeRobot are written here as their format has them, and read as logs."""

import json

import numpy as np
import pandas as pd
import pytest

from drake_tc.errors import LogError
from drake_tc.logs.inspection.inspect import inspect_log
from drake_tc.logs.readers import read_table

TIME = np.arange(300) / 30.0
MOTORS = ["shoulder_pan.pos", "elbow_flex.pos"]


def data_set(folder, *, named: bool = True, episodes: int = 1):
    (folder / "meta").mkdir(parents=True)
    names = MOTORS if named else None
    features = {"observation.state": {"dtype": "float32", "shape": [2], "names": names}, "action": {"names": names}}
    (folder / "meta" / "info.json").write_text(json.dumps({"fps": 30, "features": features}))
    path = folder / "data" / "chunk-000" / "episode_000000.parquet"
    path.parent.mkdir(parents=True)
    state = np.column_stack([40.0 * np.sin(TIME), 30.0 * np.cos(TIME)])
    pd.DataFrame(
        {
            "observation.state": list(state),
            "action": list(state + 1.0),
            "timestamp": TIME,
            "episode_index": np.arange(300) * episodes // 300,
        }
    ).to_parquet(path)
    return path


def test_members_are_named_by_the_data_set(tmp_path):
    table = read_table(data_set(tmp_path))
    assert list(table.columns[:2]) == ["shoulder_pan/pos", "elbow_flex/pos"]
    np.testing.assert_allclose(table["elbow_flex/pos_command"], 30.0 * np.cos(TIME) + 1.0)


def test_inspect_finds_the_joints(tmp_path):
    rig = inspect_log(data_set(tmp_path)).rig
    assert rig["joints"] == ["shoulder_pan", "elbow_flex"] and rig["drive"] == "position_servo"
    assert rig["columns"]["elbow_flex/position_command"] == "elbow_flex/pos_command"
    assert rig["units"]["elbow_flex/position"] == "deg"


def test_without_names_members_are_numbered(tmp_path):
    table = read_table(data_set(tmp_path, named=False))
    assert {"observation.state/0", "action/1"} <= set(table.columns)


def test_several_episodes_are_no_run(tmp_path):
    with pytest.raises(LogError, match="episodes 0 to 2 in one file; expected one run a file"):
        read_table(data_set(tmp_path, episodes=3))
