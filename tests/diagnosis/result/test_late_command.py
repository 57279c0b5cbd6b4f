"""A late command that is called a late loop: the note has its delay and its friction."""

from dataclasses import replace

import numpy as np
import pytest

from drake_tc.diagnosis.problem.columns import Term
from drake_tc.diagnosis.problem.prepared import Prepared, prepare_joint
from drake_tc.diagnosis.problem.regression import Fit, fit
from drake_tc.diagnosis.result.late_command import late_command
from drake_tc.effects.library import effect
from drake_tc.logs.record import Run
from drake_tc.logs.rig import parse_rig

from ..rigs import WAVES, sines
from ..stick_slip import JOINT, Servo, simulated

SERVO = Servo(period=5e-3, duration=15.0, stiffness=12.0, inertia=0.008, viscous=0.25, coulomb=0.05, length=0.15)
RIG = parse_rig(
    {
        "joint": JOINT,
        "drive": "position_servo",
        "command_hold": True,
        "load": {"pendulum": {"mass": SERVO.mass, "length": SERVO.length}},
    }
)


def run(shift: float, late: float) -> Run:
    time = SERVO.times()
    sent, acts = (sines(t, WAVES, shift)[0] for t in (time, np.maximum(time - late, 0.0)))
    position = SERVO.encoder(simulated(SERVO, acts), np.random.default_rng(round(100 * shift)))
    return SERVO.run(f"run{shift}", {f"{JOINT}/position": position, f"{JOINT}/position_command": sent})


def made(late: float, inertia: tuple[str, ...]) -> tuple[Prepared, Fit]:
    """The rows, and a model with a delay of the loop."""
    rig = replace(RIG, declared={JOINT: dict.fromkeys(("viscous", "coulomb", *inertia))})
    prepared = prepare_joint([run(shift, late) for shift in (0.0, 0.4)], [], rig, JOINT)
    return prepared, fit(prepared.train, [*prepared.terms, Term(effect("delay.loop"), {"delay": late})])


def test_the_other_form_of_the_delay_and_its_friction_are_told():
    """A rotor inertia that is fitted takes up what distinguishes the two."""
    prepared, loop = made(0.02, ("rotor_inertia",))
    (note,) = late_command(prepared.train, loop)
    assert note.found == pytest.approx(SERVO.viscous + SERVO.stiffness * 0.02, rel=0.05)
    assert note.viscous == pytest.approx(SERVO.viscous, abs=0.5 * (note.found - SERVO.viscous))
    assert note.delay == pytest.approx(0.02, abs=0.01)


def test_nothing_is_said_without_a_delay_of_the_loop():
    prepared, _ = made(0.0, ())
    assert late_command(prepared.train, fit(prepared.train, prepared.terms)) == ()
    command = Term(effect("delay.command"), {"delay": 0.02})
    assert late_command(prepared.train, fit(prepared.train, [*prepared.terms, command])) == ()
