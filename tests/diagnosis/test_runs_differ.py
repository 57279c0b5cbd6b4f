"""Friction that differs from run to run is neither an effect nor structure, as long as it differs no more than that."""

from dataclasses import replace

import pytest

from drake_tc.diagnosis.diagnose import diagnose_joint
from drake_tc.diagnosis.notes import RunsDiffer
from drake_tc.diagnosis.options import DiagnosisOptions
from drake_tc.diagnosis.result.joint_result import JointResult
from drake_tc.effects.library import effect

from .rigs import Joint, record, rig_of

SOUND = Joint(duration=12.0, period=4e-3, torque_noise=0.02, encoder_step=1e-5)
NEAR = DiagnosisOptions(effects=(effect("load_dependent_friction"), effect("quadratic_viscous")))


def diagnosed(shares: tuple[float, ...], held_out: float) -> JointResult:
    """Of a sound joint whose friction is that of the joint times 1 + share, run by run."""
    runs = [
        record(
            replace(SOUND, viscous=(1.0 + share) * SOUND.viscous, coulomb=(1.0 + share) * SOUND.coulomb),
            f"run{number}",
            0.9 * number,
            number,
        )
        for number, share in enumerate((*shares, held_out))
    ]
    return diagnose_joint(runs[:-1], runs[-1:], rig_of(SOUND), "joint", NEAR)


def test_a_held_out_run_that_differs_as_the_training_runs_do_lacks_nothing():
    result = diagnosed((0.03, -0.03, 0.01), -0.04)
    assert result.verdict == "no_missing_effect" and not result.effects
    (note,) = [note for note in result.notes if isinstance(note, RunsDiffer)]
    assert note.ratio > 3.0
    # what the report says of it is one and the same: the error after, over the noise floor
    assert result.unexplained.floors == pytest.approx(result.after.heldout / result.noise_floor)


@pytest.mark.slow
def test_a_held_out_run_with_another_friction_is_told():
    result = diagnosed((0.01, -0.01, 0.005), 0.25)
    assert result.verdict == "unexplained_structure" and result.unexplained.floors > 3.0


@pytest.mark.slow
def test_runs_that_do_not_differ_say_nothing_of_it():
    result = diagnosed((0.0, 0.0), 0.0)
    assert result.verdict == "no_missing_effect"
    assert not [note for note in result.notes if isinstance(note, RunsDiffer)]
