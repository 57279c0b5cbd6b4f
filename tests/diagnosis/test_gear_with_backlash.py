"""While the motor crosses the gap the link's encoder does not say where it is: those rows take no part."""

import json
from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose

from drake_tc.diagnosis.data.open_gap import OpenGap
from drake_tc.effects.base import plain_signals
from drake_tc.effects.cable_spring import CableSpring
from drake_tc.report.report_json import joint_json

from .gear_with_backlash import Gear, diagnose


@pytest.mark.slow
def test_a_soft_gear_has_a_report_that_can_be_written() -> None:
    gear = Gear(backlash=0.0, contact=8e3)
    found = diagnose(gear)
    (soft,) = [e for e in found.effects if e.id == "elasticity"]
    assert_allclose(soft.parameters["compliance"].value, 1.0 / gear.contact, rtol=0.1)
    assert json.loads(json.dumps(joint_json(found)))["effects"][0]["id"] == "elasticity"


def test_the_gap_is_open_around_each_change_of_sign_of_one_of_the_torques() -> None:
    """Load 5 s to 10 s, a spring moves the change of sign from 5.0 to 4.0 s; segments do not see each other."""
    time = np.arange(200) * 0.05
    signals = replace(plain_signals(200, {"position": np.ones(200), "load_torque": time - 5.01}), period=0.05)
    segments = (slice(0, 120), slice(120, 200))
    alone = OpenGap(0.1).is_open(signals, segments)
    assert_allclose(time[alone], [4.9, 4.95, 5.0, 5.05, 5.1][: alone.sum()], atol=0.051)
    assert alone.sum() == 5
    pulled = OpenGap(0.1, ((CableSpring(), {}, np.array([1.0, 0.0])),)).is_open(signals, segments)
    assert pulled.sum() == 10
    assert (pulled & alone).sum() == 5
    apart = replace(signals, load_torque=np.where(time < 6.0, 1.0, -1.0))
    assert not OpenGap(0.1).is_open(apart, segments).any()
