"""The load of a pendulum at positions that a sensor's error moves far: exact, not its tangent."""

from dataclasses import replace
from types import SimpleNamespace
from typing import cast

import numpy as np
import pytest
from numpy.testing import assert_allclose

from drake_tc.diagnosis.data.samples import Samples
from drake_tc.diagnosis.diagnose import diagnose_joint
from drake_tc.diagnosis.options import DiagnosisOptions
from drake_tc.diagnosis.problem.columns import Term
from drake_tc.diagnosis.split import bent_load
from drake_tc.effects.base import Effect, plain_signals
from drake_tc.effects.library import effect

from . import pendulum_rig

WEIGHT, INERTIA = 2.5, 0.4


def swinging() -> Samples:
    """Signals of a pendulum that is recorded 0.3 rad, or some wave of a turn, away from its true angle."""
    q, a = np.linspace(-2.0, 2.0, 101), np.linspace(3.0, -5.0, 101)
    known = {
        "position": q,
        "acceleration": a,
        "load_torque": WEIGHT * np.sin(q) + INERTIA * a,
        "load_slope": WEIGHT * np.cos(q),
    }
    signals = replace(plain_signals(q.size, known), link_inertia=INERTIA)
    return cast(Samples, SimpleNamespace(signals=signals, load_unknown=False))


def of_key(key: str) -> Effect:
    found = effect(key)
    assert isinstance(found, Effect)
    return found


@pytest.mark.parametrize(
    ("key", "theta"), [("encoder_offset", [0.3]), ("encoder_offset", [-0.25]), ("encoder_eccentricity", [0.1, -0.2])]
)
def test_tangent_and_bend_are_the_load_at_the_true_angle(key, theta):
    samples = swinging()
    q = samples.signals.position
    error = np.full(q.size, theta[0]) if key == "encoder_offset" else theta[0] * np.sin(q) + theta[1] * np.cos(q)
    bent = bent_load(samples, [Term(of_key(key), {})], np.array([2.0, *theta]))
    tangent = samples.signals.load_torque - samples.signals.load_slope * error
    truth = WEIGHT * np.sin(q - error) + INERTIA * samples.signals.acceleration
    assert_allclose(tangent + bent, truth, atol=1e-12)  # rounding


def test_a_zero_that_is_17_degrees_wrong_leaves_the_other_parameters_right():
    swing = pendulum_rig.Swing(constant=0.0, duration=12.0, period=4e-3, effort_noise=1e-3)
    load = {"mass": 1.0, "length": swing.moment / 9.81, "inertia": swing.inertia - 0.05, "zero": swing.zero - 0.3}
    rig = pendulum_rig.rig_of(swing, {"pendulum": load}, declared={"rotor_inertia": 0.05}, drive_gain=None)
    runs = [pendulum_rig.record(swing, f"run{k}", k, 0.37 * k) for k in range(3)]
    options = DiagnosisOptions(effects=(of_key("encoder_offset"),), assess_residual=False)
    result = diagnose_joint(runs[:2], runs[2:], rig, pendulum_rig.JOINT, options)
    found = result.final_parameters
    low, high = found["encoder_offset"]["offset"].ci95
    assert low <= 0.3 <= high
    for key, name, true in (("drive", "gain", swing.gain), ("coulomb", "coulomb", swing.coulomb)):
        assert abs(found[key][name].value / true - 1.0) < 0.01  # the tangent alone is 4 % of the weight away
