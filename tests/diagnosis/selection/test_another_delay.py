"""A servo whose goal comes late and whose rotor nobody declared: a lag of the effort imitates the two together."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from drake_tc.diagnosis.joint import diagnose_joint
from drake_tc.diagnosis.options import DiagnosisOptions
from drake_tc.diagnosis.problem.columns import Term
from drake_tc.diagnosis.problem.prepared import prepare_joint
from drake_tc.diagnosis.problem.regression import fit
from drake_tc.diagnosis.selection.engine import select
from drake_tc.diagnosis.selection.joint import _of_another_delay
from drake_tc.diagnosis.selection.joint_problem import JointProblem, Search
from drake_tc.diagnosis.selection.known_load import looks_like_known_load
from drake_tc.diagnosis.thresholds import JOINT as THRESHOLDS
from drake_tc.effects.library import effect
from drake_tc.logs.record import Run
from drake_tc.logs.rig import Rig, parse_rig

from ..rigs import sines
from ..stick_slip import JOINT, Servo, simulated

SERVO = Servo(period=0.01, duration=25.0, stiffness=12.0, inertia=0.008, viscous=0.25, coulomb=0.12, length=0.15)
WAVES = ((0.15, 0.45, 0.0), (0.37, 0.45, 1.1), (0.61, 0.25, 2.3), (0.93, 0.12, 0.4))
DELAY = 0.02
DOCUMENT: dict[str, Any] = {
    "joint": JOINT,
    "drive": "position_servo",
    "load": {"pendulum": {"mass": SERVO.mass, "length": SERVO.length}},
}
RIG: Rig = parse_rig(DOCUMENT)


def run(shift: float) -> Run:
    """One run whose goal is logged when it is sent and acts `DELAY` later."""
    time = SERVO.times()
    sent, acts = (sines(t, WAVES, shift)[0] for t in (time, np.maximum(time - DELAY, 0.0)))
    position = SERVO.encoder(simulated(SERVO, acts), np.random.default_rng(round(100 * shift)))
    return SERVO.run(f"run{shift}", {f"{JOINT}/position": position, f"{JOINT}/position_command": sent})


def test_the_two_causes_are_told_from_a_lag_that_imitates_them():
    runs = [run(shift) for shift in (0.0, 0.4, 0.7)]
    found = diagnose_joint(runs[:2], runs[2:], RIG, JOINT, DiagnosisOptions(assess_residual=False))
    values = {each.id: {k: p.value for k, p in each.parameters.items()} for each in found.effects}
    assert set(values) == {"delay", "rotor_inertia"}
    assert values["delay"]["delay"] == pytest.approx(DELAY, abs=1e-3)
    assert values["rotor_inertia"]["rotor_inertia"] == pytest.approx(SERVO.inertia, rel=0.05)


def test_a_delay_is_not_exchanged_for_a_curve_that_would_be_withdrawn():
    """The declared pendulum has a wrong zero, which a curve over the position corrects better than a delay does."""
    rig = parse_rig({**DOCUMENT, "load": {"pendulum": {**DOCUMENT["load"]["pendulum"], "zero": 0.1}}})
    prepared = prepare_joint([run(0.0), run(0.4)], [], rig, JOINT)
    effects = (effect("delay.loop"), effect("position_dependent_load"))
    known = frozenset(t.effect.key for t in prepared.terms)
    problem = JointProblem(prepared.train, effects, prepared.context, known, prepared.floor)
    plain = fit(prepared.train, prepared.terms)
    late = fit(prepared.train, [*prepared.terms, Term(effects[0], {"delay": DELAY})])
    curve = select(replace(problem, effects=effects[1:]), plain, THRESHOLDS).chosen
    assert looks_like_known_load(curve, curve.terms[-1], prepared.train)
    assert curve.cv_rms < 0.9 * late.cv_rms
    found = _of_another_delay(problem, Search(plain, late), THRESHOLDS, lambda text, share: None)
    assert found.chosen is late
