"""A servo whose goal holds for 10 ms, and one that is logged as slowly but follows a continuous command."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose

from drake_tc.diagnosis.problem.columns import Term
from drake_tc.diagnosis.problem.prepared import Prepared, prepare_joint
from drake_tc.diagnosis.problem.regression import fit
from drake_tc.effects.library import effect
from drake_tc.logs.record import Run
from drake_tc.logs.rig import Rig

from ..rigs import WAVES, sines
from ..stick_slip import JOINT, Servo, rig_of, simulated

SERVO = Servo(period=0.01, duration=25.0, stiffness=12.0, inertia=0.008, viscous=0.25, coulomb=0.05, length=0.15)
FINE = 2e-4
"""Period of the command that is as good as continuous [s]."""


def run(shift: float, *, held: bool) -> Run:
    """One run of the logged servo under a command that holds for a logged period, or hardly at all."""
    command = sines(SERVO.times(), WAVES, shift)[0]
    if held:
        position = simulated(SERVO, command)
    else:
        every = round(SERVO.period / FINE)
        fine = replace(SERVO, period=FINE)
        position = simulated(fine, sines(fine.times(), WAVES, shift)[0])[::every]
    noisy = SERVO.encoder(position, np.random.default_rng(3))
    return SERVO.run(f"run{shift}", {f"{JOINT}/position": noisy, f"{JOINT}/position_command": command})


def prepared(rig: Rig, *, held: bool) -> Prepared:
    made = [run(shift, held=held) for shift in (0.0, 0.4, 0.7)]
    return prepare_joint(made[:2], made[2:], rig, JOINT)


def viscous(found: Prepared) -> float:
    """Of the declared model, which has the rotor's inertia [N m s/rad]."""
    best = fit(found.train, [Term(effect(key)) for key in ("viscous", "coulomb", "rotor_inertia")])
    return float(best.beta[1])


@pytest.mark.parametrize("held", [True, False])
def test_the_logs_say_whether_the_command_holds(held: bool):
    found = prepared(rig_of(SERVO), held=held)
    age = 0.5 if held else 0.0
    assert found.train.samples.effort_age == age
    assert found.held.samples.effort_age == age
    # the integrator's first-order step of 0.2 ms costs up to 12 N m/rad * 0.2 ms
    assert_allclose(viscous(found), SERVO.viscous, atol=SERVO.stiffness * FINE + 2e-3)


def test_a_wrong_statement_costs_half_a_period_of_delay():
    """K T/2 of viscous friction: 0.06 N m s/rad."""
    wrong = replace(rig_of(SERVO), command_hold=False)
    excess = viscous(prepared(wrong, held=True)) - SERVO.viscous
    assert_allclose(excess, 0.5 * SERVO.stiffness * SERVO.period, rtol=0.1)
