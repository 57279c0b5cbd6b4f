"""Goals that are written and held once a cycle and logged some time before or after that: no delay is named.

A servo whose own delay is longer than half a cycle keeps it.
"""

from dataclasses import replace
from functools import partial

import numpy as np
import pytest

from drake_tc.diagnosis.diagnose import diagnose_joint
from drake_tc.diagnosis.options import DiagnosisOptions
from drake_tc.diagnosis.problem.prepared import prepare_joint
from drake_tc.diagnosis.result.joint_result import JointResult
from drake_tc.diagnosis.selection.sampling_instants import age_of_samples
from drake_tc.diagnosis.timing_notes import OlderEffort
from drake_tc.logs.record import Run
from drake_tc.logs.rig import Rig, parse_rig

from ..rigs import sines
from ..stick_slip import JOINT, Servo, simulated

PARTS = 5
"""Parts of a cycle; the log is written one part after the goal."""
CYCLE = 0.01
SERVO = Servo(
    period=CYCLE / PARTS, duration=25.0, stiffness=12.0, inertia=0.02, viscous=0.7, coulomb=0.12, mass=0.5, length=0.18
)
LOGGED = Servo(period=CYCLE, duration=SERVO.duration)
WAVES = ((0.15, 0.6, 0.0), (0.37, 0.5, 1.1), (0.61, 0.35, 2.3))
AGE = (0.5 - 1.0 / PARTS) * CYCLE
"""By how much the goal that acts is older on average than the one that is recorded [s]."""
RIG: Rig = parse_rig(
    {
        "joint": JOINT,
        "drive": "position_servo",
        "load": {"pendulum": {"mass": SERVO.mass, "length": SERVO.length}},
        "declared": {"rotor_inertia": SERVO.inertia},
    }
)


def run(shift: float, after: int = 1) -> Run:
    """One run, logged `after` fifths of a cycle after each goal was written; negative: before."""
    goals = np.repeat(sines(LOGGED.times(), WAVES, shift)[0], PARTS)
    acting = np.concatenate([np.full(max(-after, 0), goals[0]), goals])[: goals.size]
    position = SERVO.encoder(simulated(SERVO, acting), np.random.default_rng(round(100 * shift)))
    first = max(after, 0)
    columns = {f"{JOINT}/position": position[first::PARTS], f"{JOINT}/position_command": goals[first::PARTS]}
    return LOGGED.run(f"run{shift}", columns)


@pytest.fixture(scope="module")
def runs() -> list[Run]:
    return [run(shift) for shift in (0.0, 0.4, 0.7)]


@pytest.mark.slow
def test_a_goal_that_is_logged_after_it_was_written_is_no_delay(runs):
    found = diagnose_joint(runs[:2], runs[2:], RIG, JOINT, DiagnosisOptions(assess_residual=False))
    assert [each.key for each in found.effects] == []
    (older,) = (note for note in found.notes if isinstance(note, OlderEffort))
    assert older.age == pytest.approx(AGE, abs=4e-4)
    viscous = found.final_parameters["viscous"]["viscous"]
    assert viscous.value == pytest.approx(SERVO.viscous, rel=0.01)


def test_the_age_of_the_goal_is_found_beside_any_model(runs):
    """Beside other effects no delay is chosen, and these take the place of the age."""
    prepare = partial(prepare_joint, runs[:2], runs[2:], RIG, JOINT, command_held=False)
    plain = prepare()
    older = age_of_samples(None, prepare, plain, plain.terms)
    assert older is not None
    assert older.train.samples.effort_age * CYCLE == pytest.approx(AGE, abs=4e-4)
    assert age_of_samples(False, prepare, plain, plain.terms) is None


@pytest.mark.slow
def test_the_same_delay_is_named_if_the_rig_file_states_the_hold():
    found = diagnose(-2, replace(RIG, command_hold=True))
    assert [each.key for each in found.effects] == ["delay.command"]
    assert found.final_parameters["delay.command"]["delay"].value == pytest.approx(0.4 * CYCLE, abs=6e-4)


def diagnose(after: int, rig: Rig) -> JointResult:
    runs = [run(shift, after) for shift in (0.0, 0.4, 0.7)]
    return diagnose_joint(runs[:2], runs[2:], rig, JOINT, DiagnosisOptions(assess_residual=False))
