"""A current that is logged after it acted: it is taken earlier, friction is right again, and no effect is named."""

from dataclasses import replace

import numpy as np
import pytest

from drake_tc.diagnosis.diagnose import diagnose_joint
from drake_tc.diagnosis.options import DiagnosisOptions
from drake_tc.diagnosis.result.joint_result import JointResult
from drake_tc.diagnosis.timing_notes import RecordedLate
from drake_tc.logs.record import Run

from .test_sampling_instants import COULOMB, PERIOD, RIG, VISCOUS, run

pytestmark = pytest.mark.slow


def logged_late(recorded: Run, samples: int) -> Run:
    """The run with the current of `samples` samples before; its first ones are repeated."""
    current = recorded.columns["joint/current"]
    late = np.concatenate([np.full(samples, current[0]), current[: current.size - samples]])
    return replace(recorded, columns={**recorded.columns, "joint/current": late})


def diagnosed(samples: int) -> JointResult:
    runs = [logged_late(run(shift, 0.0), samples) for shift in (0.0, 0.4, 0.7)]
    return diagnose_joint(runs[:2], runs[2:], RIG, "joint", DiagnosisOptions(assess_residual=False))


@pytest.mark.parametrize("samples", [4])
def test_the_report_says_by_how_much_and_friction_is_right(samples):
    """Half a period of the hold makes the lead shorter."""
    found = diagnosed(samples)
    (late,) = (note for note in found.notes if isinstance(note, RecordedLate))
    assert late.lead == pytest.approx((samples - 0.5) * PERIOD, abs=0.2 * PERIOD)
    assert found.effects == ()
    assert found.final_parameters["viscous"]["viscous"].value == pytest.approx(VISCOUS, rel=0.05)
    assert found.final_parameters["coulomb"]["coulomb"].value == pytest.approx(COULOMB, rel=0.05)
