"""The benchmark of contact approximations: its reference against energy and small angles, and what it says of Drake."""

import dataclasses

import numpy as np
import pytest
from drake_tc.diagrams.tsid import floor_bench
from drake_tc.diagrams.tsid.floor_bench import (
    FRICTION,
    GRAVITY,
    GYRATION,
    HIGH,
    MASS,
    SOFT,
    SOLE,
    creep,
    lift_while_sliding,
    make_foot,
    rocking,
    rocking_error,
    stopping_distance,
)
from drake_tc.diagrams.tsid.ground import touching_points
from drake_tc.diagrams.tsid.ground_spec import GroundSpec, SoleSpec
from numpy.testing import assert_allclose

HARD, SOFT_SOLE = GroundSpec(friction=FRICTION), GroundSpec(friction=FRICTION, sole=SOFT)


def test_the_reference_rocks_at_the_frequency_of_small_angles(monkeypatch):
    """I_p w^2 = k r^2 - m g h about the floor, undamped, of a foot that neither lifts an edge nor slides."""
    spec = GroundSpec(friction=50.0, sole=SoleSpec(2.0e5, dissipation=0.0))
    monkeypatch.setattr(floor_bench, "TILT", 1e-3)
    depth = MASS * GRAVITY / 2.0e5
    times = np.linspace(0.0, 0.6, 601)
    angles = rocking(spec, HIGH * np.sin(1e-3), HIGH * np.cos(1e-3) - depth, times)
    spread = np.mean(touching_points(SOLE, spec)[:, 0] ** 2)
    turning = MASS * (GYRATION[1] + HIGH**2)
    frequency = np.sqrt((2.0e5 * spread - MASS * GRAVITY * HIGH) / turning)
    assert_allclose(angles, 1e-3 * np.cos(frequency * times), atol=5e-5)


def test_a_foot_at_rest_carries_its_weight():
    foot = make_foot(SOFT_SOLE, HIGH)
    foot.simulator.AdvanceTo(2.0)
    assert foot.place()[2] == pytest.approx(-MASS * GRAVITY / SOFT.stiffness, rel=5e-3)
    assert foot.pitch() == pytest.approx(0.0, abs=1e-6)


def test_the_default_floor_slides_and_rocks_as_the_equations_say():
    """README: why `lagged` is the default. A foot that slides stops where friction stops it, and does not take off."""
    assert HARD.approximation == "lagged"
    for spec in (HARD, SOFT_SOLE):
        assert stopping_distance(spec) == pytest.approx(1.0, abs=0.02)
        assert abs(lift_while_sliding(spec)) < 1e-5
        assert 0.0 < creep(spec) < 1e-4
    assert rocking_error(SOFT_SOLE) < 4e-3


def test_sap_lifts_a_foot_that_slides_and_damps_one_that_rocks():
    """README: why `sap` is not the default."""
    hard, soft = (dataclasses.replace(spec, approximation="sap") for spec in (HARD, SOFT_SOLE))
    assert lift_while_sliding(hard) > 0.02
    assert rocking_error(soft) > 3.0 * rocking_error(SOFT_SOLE)
    assert creep(hard) < 0.05 * creep(HARD)
