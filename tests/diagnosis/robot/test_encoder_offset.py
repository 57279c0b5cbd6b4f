"""A wrong zero of one encoder of an arm whose links are known: all loads are computed from it."""

import numpy as np
import pytest
from fitted_arm import URDF, diagnosed_as_known


def shifted(path, joint, offset):
    """The log with another zero of this joint."""
    columns = dict(np.load(path))
    columns[f"{joint}/position"] = columns[f"{joint}/position"] + offset
    np.savez(path, **columns)
    return path


def diagnosed(folder, seed, joint, offset=0.03, **rig_keys):
    """What is found where one encoder is `offset` [rad] off."""
    return diagnosed_as_known(folder, seed, change=lambda log: shifted(log, joint, offset), **rig_keys)


@pytest.mark.parametrize(
    ("joint", "seed", "offset"),
    [
        ("fold", 1, 0.03),
        pytest.param("lift", 0, 0.03, marks=pytest.mark.slow),
        pytest.param("lift", 2, 0.06, marks=pytest.mark.slow),
    ],
)
def test_the_encoder_is_named_with_its_offset(tmp_path, joint, seed, offset):
    result = diagnosed(tmp_path, seed, joint, offset)
    (cause,) = result.shared
    assert (cause.id, cause.where) == ("encoder_offset", joint)
    found = cause.parameters["offset"]
    assert found.value == pytest.approx(offset, rel=0.02)
    assert found.ci95[0] < offset < found.ci95[1]
    assert all(joint.effects == () for joint in result.joints.values())
    assert result.set_up is None or result.set_up.errors == ()


def test_an_arm_that_is_as_its_file_says_has_no_cause(tmp_path):
    assert diagnosed_as_known(tmp_path, 3).shared == ()


@pytest.mark.slow
def test_a_centre_of_mass_stays_one(tmp_path):
    """Of the last link, along it: no turn of a joint moves it like that."""
    moved = URDF.replace('xyz="0.15 0.01 0"', 'xyz="0.19 0.01 0"')
    assert moved != URDF
    (cause,) = diagnosed_as_known(tmp_path, 4, true=moved).shared
    assert (cause.id, cause.where) == ("link_com", "fore")
    assert cause.parameters["com_x"].value == pytest.approx(0.04, abs=0.005)


@pytest.mark.slow
def test_an_offset_within_its_tolerance_is_not_named(tmp_path):
    sensors = {"encoder": {"offset": "1 deg"}}
    result = diagnosed(tmp_path, 5, "lift", sensors=sensors)
    assert result.shared == ()
    assert all(joint.effects == () for joint in result.joints.values())
