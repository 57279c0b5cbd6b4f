"""Joints identified from public logs: each file loads, states its source and licence, and gives ranges."""

import math
from pathlib import Path

import pytest

import drake_tc.models
from drake_tc.actuation.model_file import load_model_file
from drake_tc.exchange.ranges.unit import GAIN, read_unit

FILES = sorted((Path(drake_tc.models.__file__).parent / "public").glob("*.yaml"))


def test_there_are_some():
    assert FILES


@pytest.mark.parametrize("path", FILES, ids=lambda path: path.stem)
def test_a_file_states_where_its_numbers_come_from(path):
    about = load_model_file(path).provenance
    assert about["source"].startswith("github.com/") and about["licence_of_the_logs"]
    assert about["command"] == f"python docs/record_public_joints.py DATA {path.stem}"
    for joint, errors in about["error"].items():
        assert 0.0 < errors["heldout"] < math.inf, joint
        low, high = about["drive_gain"][joint]["ci95"]
        assert 0.0 < low < load_model_file(path).models[joint].drive.gain < high


@pytest.mark.parametrize("path", FILES, ids=lambda path: path.stem)
def test_its_intervals_hold_the_values(path):
    unit = read_unit(path)
    for found in unit.estimated.values():
        assert found
        for each in found:
            assert each.key != GAIN  # an actuator file has no place for its interval
            low, high = each.distribution.interval
            assert low < each.distribution.value < high, each.key
