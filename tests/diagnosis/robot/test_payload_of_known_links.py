"""What an arm with known links carries in all logs: a tool that its URDF lacks."""

import numpy as np
import pytest
from fitted_arm import PLACE, URDF, diagnosed_as_known

from drake_tc.diagnosis.selection.shared import _is_a_body

TOOL = 0.25
"""[kg], a fifth of the mass of the link that carries it."""


@pytest.mark.parametrize("seed", [0, 1])
def test_a_tool_is_named_with_its_mass_and_place(tmp_path, seed):
    result = diagnosed_as_known(tmp_path, seed, payload=TOOL)
    (cause,) = result.shared
    assert (cause.id, cause.where) == ("payload", "fore")
    found = cause.parameters
    assert found["mass"].value == pytest.approx(TOOL, rel=0.05)
    assert found["com_x"].value == pytest.approx(PLACE[0], abs=0.02)
    for name, truth in zip(("mass", "com_x", "com_y", "com_z"), (TOOL, *PLACE), strict=True):
        assert found[name].ci95[0] < truth < found[name].ci95[1]
    assert all(joint.effects == () for joint in result.joints.values())
    assert result.set_up is None or result.set_up.errors == ()


def test_a_wrong_mass_at_the_right_centre_stays_one(tmp_path):
    """A payload would explain it as well, with nine parameters more."""
    heavier = URDF.replace('mass value="1.2"', 'mass value="1.45"')
    assert heavier != URDF
    (cause,) = diagnosed_as_known(tmp_path, 3, true=heavier).shared
    assert (cause.id, cause.where) == ("link_mass", "fore")
    assert cause.parameters["mass"].value == pytest.approx(0.25, rel=0.05)


def test_a_wrong_link_further_in_is_no_payload(tmp_path):
    heavier = URDF.replace('mass value="2"', 'mass value="2.4"')
    assert heavier != URDF
    (cause,) = diagnosed_as_known(tmp_path, 4, true=heavier).shared
    assert (cause.id, cause.where) == ("link_mass", "boom")


def test_what_cannot_be_a_body_is_none():
    certain = np.full(10, 1e-3)
    far = np.array([-0.2, -0.5, 0.0, 0.0, *(0.0,) * 6])
    assert _is_a_body(np.array([-0.2, -0.05, 0.0, 0.0, *(0.0,) * 6]), certain)
    assert not _is_a_body(far, certain)
    assert not _is_a_body(np.array([-0.2, -0.05, 0.0, 0.0, *(0.0,) * 6]), 0.1 + certain)


def test_an_arm_as_its_file_says_carries_nothing(tmp_path):
    assert diagnosed_as_known(tmp_path, 5).shared == ()
