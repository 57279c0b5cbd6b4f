"""Causes that a curve of free form explains as well or nearly so, on a pendulum."""

import numpy as np
from numpy.testing import assert_allclose

from drake_tc.diagnosis.diagnose import diagnose_joint
from drake_tc.diagnosis.options import DiagnosisOptions
from drake_tc.logs.rig import parse_rig

from ..coarse_pendulum import LENGTH, MASS, RIG, ROTOR, pendulum

AMPLITUDE, CYCLES = 0.3, 9.0


def ripple(q: np.ndarray, v: np.ndarray) -> np.ndarray:
    """A cos(9 q + 0.4) [N m]: little more than two periods over the motion, which a spline follows too."""
    return AMPLITUDE * np.cos(CYCLES * q + 0.4) + 0.0 * v


def test_a_curve_is_the_last_resort():
    runs = [pendulum(shift, ripple) for shift in (0.0, 0.4, 0.7)]
    options = DiagnosisOptions(assess_residual=False)
    found = diagnose_joint(runs[:2], runs[2:], RIG, "joint", options)
    values = {each.id: {k: p.value for k, p in each.parameters.items()} for each in found.effects}
    assert set(values) == {"rotor_inertia", "torque_ripple"}
    wave = values["torque_ripple"]
    assert_allclose(wave["cycles_per_turn"], CYCLES, rtol=0.01)
    assert_allclose(np.hypot(wave["ripple_cosine"], wave["ripple_sine"]), AMPLITUDE, rtol=0.05)
    assert_allclose(values["rotor_inertia"]["rotor_inertia"], ROTOR, rtol=0.05)


def tilted(q: np.ndarray, v: np.ndarray) -> np.ndarray:
    """A constant of 0.25 N m, and 3 % less load than declared [N m]."""
    return 0.25 - 0.03 * MASS * 9.81 * LENGTH * np.sin(q) + 0.0 * v


def test_a_curve_in_the_form_of_the_known_load_does_not_hide_a_constant():
    """The curve leaves a little less and is withdrawn as an error of the declared load: nothing would be found."""
    rig = parse_rig(
        {
            "joint": "joint",
            "drive": "current",
            "load": {"pendulum": {"mass": MASS, "length": LENGTH}},
            "declared": {"rotor_inertia": ROTOR},
        }
    )
    runs = [pendulum(shift, tilted) for shift in (0.0, 0.4, 0.7)]
    found = diagnose_joint(runs[:2], runs[2:], rig, "joint", DiagnosisOptions(assess_residual=False))
    assert {each.id for each in found.effects} & {"asymmetric_friction", "effort_bias", "encoder_offset"}
