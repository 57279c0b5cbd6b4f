"""What a call with many logs says of them: each kind of repair once, with the names of the logs."""

import re

import numpy as np
import pytest

from drake_tc.logs.prepare import load_runs
from drake_tc.logs.record import distinct_notes, of_joint
from drake_tc.logs.rig import parse_rig

from .conftest import bench, write

LOGS = 25


@pytest.fixture(scope="module")
def notes(tmp_path_factory):
    """(log, note) of 25 logs of two joints, each with the same five faults in other places."""
    folder = tmp_path_factory.mktemp("many")
    rng = np.random.default_rng(0)
    paths = []
    for k in range(LOGS):
        table = bench(2.0, joint="joint1", seed=k)
        other = bench(2.0, joint="joint2", seed=100 + k).drop(columns="time")
        table = table.join(other).assign(input_volts=24.0, status=k)
        table["time"] += 1.7e9 + 100.0 * k
        for joint in ("joint1", "joint2"):
            table.loc[rng.choice(np.arange(10, 1500, 10), 5 + k), f"{joint}/temperature"] = np.nan
        first = 100 + 10 * k
        table.loc[first : first + 40 + k, "joint2/torque"] = np.nan
        table["torque_on"] = (np.arange(len(table)) < 1700 + k).astype(int)
        table["ankle/position"] = 0.0
        paths.append(write(table, folder / f"run_{k:02d}.csv"))
    rig = parse_rig({"joints": ["joint1", "joint2"], "drive": "position_servo", "enabled": "torque_on"})
    return [(run.name, note) for run in load_runs(paths, rig) for note in run.notes]


def test_each_kind_is_one_sentence_that_names_its_logs(notes):
    assert len(notes) > 5 * LOGS
    told = distinct_notes(notes)
    assert len(told) == len({sentence.split(": ", 1)[1] for sentence in told}) <= 8
    for sentence in told:
        assert sentence.startswith("run_") and re.search(r" and \d+ more logs", sentence)


def test_a_joint_is_told_of_its_own_columns_and_of_the_whole_log(notes):
    one, two = (distinct_notes(of_joint(notes, joint, ["joint1", "joint2"])) for joint in ("joint1", "joint2"))
    assert not any("joint2/torque" in sentence for sentence in one)
    assert sum("joint2/torque" in sentence for sentence in two) == 1
    assert sum("input_volts" in sentence for sentence in (*one, *two)) == 1
    for told in (one, two):
        assert sum("drive switched off" in sentence for sentence in told) == 1
        assert sum("ankle" in sentence for sentence in told) == 1


def test_numbers_in_names_are_no_numbers_and_signs_are():
    told = distinct_notes([("a", "Column joint_1/torque is odd."), ("a", "Column joint_2/torque is odd.")])
    assert len(told) == 2
    taken_off = "Sensor ft_foot: [{}] were taken off."
    told = distinct_notes([("a", taken_off.format("3, -2")), ("b", taken_off.format("1.5, 2"))])
    assert told == ("a: Sensor ft_foot: [3, -2] were taken off. The same, with other numbers, holds for b.",)


def test_notes_with_other_numbers_are_told_once():
    same = [(f"run{n}", "Column 'temp' looks like a temperature.") for n in range(40)]
    counted = [("a", "3 rows were left out."), ("b", "17 rows were left out.")]
    assert distinct_notes([*same[:1], *counted[:1], *same[1:], *counted[1:]]) == (
        "run0, run1, run2 and 37 more logs: Column 'temp' looks like a temperature.",
        "a: 3 rows were left out. The same, with other numbers, holds for b.",
    )
    assert distinct_notes([]) == ()


def test_notes_of_other_joints_are_left_out():
    notes = [("a", "Column knee/torque is frozen."), ("a", "Column left_knee/torque is frozen."), ("a", "A gap.")]
    assert of_joint(notes, "knee", ["knee", "left_knee"]) == [notes[0], notes[2]]
    assert np.shape(of_joint(notes, "left_knee", ["knee", "left_knee"])) == (2, 2)
