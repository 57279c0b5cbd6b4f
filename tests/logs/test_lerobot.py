"""Data sets of LeRobot are written here as their format has them, and read as logs."""

import json
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from drake_tc.errors import LogError
from drake_tc.logs.files.episodes import require_different_files
from drake_tc.logs.files.readers import read_table
from drake_tc.logs.inspection import inspect_log, trial
from drake_tc.logs.prepare import load_run
from drake_tc.logs.rig import parse_rig

MOTORS = ["shoulder_pan.pos", "elbow_flex.pos"]


def written(folder, *, version=3, names=MOTORS, episodes=(200, 300, 250), beside=("effort",), scale=1.0):
    """A data set of version 2 or 3 as LeRobot writes it: pictures among the features, float32 lists, 50 frames/s."""
    lists = ["observation.state", "action", *(f"observation.{key}" for key in beside)]
    features = {key: {"dtype": "float32", "shape": [2], "names": names} for key in lists}
    features |= {"observation.images.top": {"dtype": "video", "shape": [480, 640, 3], "names": ["h", "w", "c"]}}
    features |= {key: {"dtype": "int64", "shape": [1], "names": None} for key in ("episode_index", "index")}
    (folder / "meta").mkdir(parents=True)
    info = {"codebase_version": f"v{version}.0", "fps": 50, "features": features}
    (folder / "meta" / "info.json").write_text(json.dumps(info))
    tables = []
    for episode, count in enumerate(episodes):
        time = np.arange(count) / 50.0
        state = scale * np.column_stack([np.sin((2.0 + episode) * time), np.cos(3.0 * time)]).astype(np.float32)
        columns = {key: list(state) for key in lists} | {"action": list(state + np.float32(0.1))}
        columns |= {"timestamp": time.astype(np.float32), "episode_index": episode, "index": np.arange(count)}
        tables.append(pd.DataFrame(columns))
    place = folder / "data" / "chunk-000"
    place.mkdir(parents=True)
    if version == 3:
        (folder / "meta" / "episodes" / "chunk-000").mkdir(parents=True)
        pd.concat(tables).to_parquet(place / "file-000.parquet", index=False)
    else:
        for episode, table in enumerate(tables):
            table.to_parquet(place / f"episode_{episode:06d}.parquet", index=False)
    return folder


def first_file(folder, **options):
    return written(folder, version=2, episodes=(300,), beside=(), **options) / "data/chunk-000/episode_000000.parquet"


def test_members_of_one_file_are_named_by_the_data_set(tmp_path):
    table = read_table(first_file(tmp_path / "named"))
    assert list(table.columns[:2]) == ["shoulder_pan/pos", "elbow_flex/pos"]
    np.testing.assert_allclose(table["elbow_flex/pos_command"], np.cos(0.06 * np.arange(300)) + 0.1, atol=1e-6)
    unnamed = read_table(first_file(tmp_path / "unnamed", names=None))
    assert {"joint_0/position", "joint_1/position_command"} <= set(unnamed.columns)


def test_inspect_finds_the_joints(tmp_path):
    rig = inspect_log(first_file(tmp_path, scale=40.0)).rig
    assert rig["joints"] == ["shoulder_pan", "elbow_flex"] and rig["drive"] == "position_servo"
    assert rig["columns"]["elbow_flex/position_command"] == "elbow_flex/pos_command"
    assert rig["units"]["elbow_flex/position"] == "deg"


@pytest.mark.parametrize("version", [2, 3])
@pytest.mark.parametrize(
    "names",
    [
        ["hip", "knee"],
        {"motors": ["hip", "knee"]},
        [["hip", "knee"]],
        {"hip": 0, "knee": 1},
        ["hip.pos", "knee.pos"],
    ],
)
def test_a_folder_is_a_log_of_its_episodes(tmp_path, version, names):
    folder = written(tmp_path / "set", version=version, names=names)
    found = inspect_log(folder)
    assert trial(found) == "" and found.rig["joints"] == ["hip", "knee"] and found.gaps == 2
    rig = parse_rig(dict(found.rig))
    whole = load_run(folder, rig)
    parts = [whole.columns["hip/position"][part] for part in whole.segments()]
    assert len(parts) == 3
    for episode, part in enumerate(parts):
        time = np.arange((200, 300, 250)[episode]) / 50.0
        np.testing.assert_allclose(part, np.sin((2.0 + episode) * time), rtol=0, atol=2e-6)  # single precision
        alone = load_run(Path(f"{folder}#{episode}"), rig)
        np.testing.assert_allclose(alone.columns["hip/position"], part, rtol=0, atol=2e-6)
        assert alone.name == f"set#{episode}"


def test_lists_beside_the_state_name_their_quantity(tmp_path):
    table = read_table(written(tmp_path / "set", names=["hip", "knee"], beside=("effort", "velocity")))
    assert {"hip/position", "hip/position_command", "hip/velocity", "hip/effort"} <= set(table.columns)
    assert not any("image" in name for name in table.columns)


def test_an_episode_that_is_not_there_and_one_given_twice(tmp_path):
    folder = written(tmp_path / "set", names=["hip", "knee"])
    with pytest.raises(LogError, match=r"no episode 3; episodes here: 0 to 2"):
        read_table(Path(f"{folder}#3"))
    with pytest.raises(LogError, match=r"set#1: .*set is also given and has all episodes"):
        require_different_files([folder], [Path(f"{folder}#1")])
    require_different_files([Path(f"{folder}#0")], [Path(f"{folder}#1")])


@pytest.mark.parametrize("ending", [".csv", ".parquet", ".npz"])
def test_a_column_of_any_file_may_number_the_episodes(tmp_path, ending):
    time = np.tile(np.arange(100) / 50.0, 2)
    own = {"episode": np.repeat([3, 5], 100), "time": time, "q": np.sin(time) + np.repeat([0.0, 1.0], 100)}
    path, table = tmp_path / f"run{ending}", pd.DataFrame(own)
    if ending == ".npz":
        np.savez(path, **own)
    else:
        table.to_csv(path, index=False) if ending == ".csv" else table.to_parquet(path)
    whole = read_table(path)
    assert np.all(np.diff(whole["time"]) > 0.0) and np.sum(np.diff(whole["time"]) > 0.5) == 1
    np.testing.assert_allclose(read_table(f"{path}#5")["q"], 1.0 + np.sin(time[:100]), atol=1e-12)
    with pytest.raises(LogError, match=r"no episode 1; episodes here: 3, 5"):
        read_table(f"{path}#1")
    table.drop(columns="episode").to_parquet(tmp_path / "flat.parquet")
    with pytest.raises(LogError, match=r"no episodes in this file; expected the file without #1"):
        read_table(tmp_path / "flat.parquet#1")


def test_positions_within_a_hundred_may_be_shares_of_a_range(tmp_path):
    """LeRobot normalises positions; positions in rad are no shares."""
    for folder, scale in (("shares", 40.0), ("rad", 1.0)):
        notes = inspect_log(written(tmp_path / folder, scale=scale)).notes
        assert any("share of each joint's calibrated range" in note for note in notes) == (folder == "shares")


def test_lists_beside_names_of_their_joints_and_with_missing_rows(tmp_path):
    q = np.arange(80.0).reshape(40, 2)
    rows = [None if i == 3 else list(row) for i, row in enumerate(q)]
    pd.DataFrame({"time": np.arange(40.0), "joint_names": [["hip", "knee"]] * 40, "position": rows}).to_parquet(
        tmp_path / "run.parquet"
    )
    table = read_table(tmp_path / "run.parquet")
    np.testing.assert_allclose(
        table[["hip/position", "knee/position"]], np.where(np.arange(40)[:, None] == 3, np.nan, q)
    )
