"""The benchmark of contact approximations: its reference against energy and small angles, and what it says of Drake."""

import dataclasses

import numpy as np
import pytest
from numpy.testing import assert_allclose

from drake_tc.loops.whole_body.ground import GroundSpec, SoleSpec, touching_points
from tests.benchmarks import floor_contact as floor_bench
from tests.benchmarks.floor_contact import (
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

HARD = GroundSpec(friction=FRICTION)
SOFT_SOLE = GroundSpec(friction=FRICTION, sole=SOFT)


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


def test_soft_soles_rock_and_slide_as_the_equations_say():
    """Why `lagged` is their default: a foot stops where friction stops it, does not take off, and rocks as the ODE."""
    assert SOFT_SOLE.solver == "lagged"
    assert stopping_distance(SOFT_SOLE) == pytest.approx(1.0, abs=0.02)
    assert abs(lift_while_sliding(SOFT_SOLE)) < 1e-5
    assert 0.0 < creep(SOFT_SOLE) < 1e-5
    assert rocking_error(SOFT_SOLE) < 4e-3


def test_sap_lifts_a_foot_that_slides_and_damps_one_that_rocks():
    """Why `sap` is not the default of soft soles."""
    other = dataclasses.replace(SOFT_SOLE, approximation="sap")
    assert lift_while_sliding(other) > 5e-3
    assert rocking_error(other) > 3.0 * rocking_error(SOFT_SOLE)


def test_hard_soles_stick_and_stop():
    """`sap` is their default. It makes a sole that slides fast take off, which the README says."""
    assert HARD.solver == "sap"
    assert 0.0 <= creep(HARD) < 1e-6
    assert stopping_distance(HARD) == pytest.approx(1.0, abs=0.02)
    assert lift_while_sliding(HARD) > 0.02
    assert abs(lift_while_sliding(dataclasses.replace(HARD, approximation="lagged"))) < 1e-5
