"""A torque sensor that is late by more than its torque takes to change: it is taken earlier, and no effect is named."""

import numpy as np
import pytest

from drake_tc.diagnosis.diagnose import diagnose_joint
from drake_tc.diagnosis.options import DiagnosisOptions
from drake_tc.diagnosis.result.joint_result import JointResult
from drake_tc.diagnosis.timing_notes import TorqueRecordedLate
from drake_tc.logs.record import Run
from drake_tc.logs.rig import parse_rig

from ..rigs import Logged

pytestmark = pytest.mark.slow

GAIN, ROTOR, LINK, MOMENT, VISCOUS, COULOMB = 0.125, 0.9, 0.5, 20.0, 4.0, 5.0
FINE = 2e-4
RIG = parse_rig({"joint": "joint", "drive": "current", "declared": {"rotor_inertia": ROTOR}})
LOG = Logged(period=2e-3, duration=16.0)


def simulated(shift: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Position, current and torque between gear and link (T,): a pendulum with stiction under a PD loop."""
    time = LOG.times()
    goal = 0.5 * np.sin(0.9 * time + shift) + 0.25 * np.sin(4.1 * time + 2.0 * shift)
    rate = np.gradient(goal, LOG.period)
    q, v, out = float(goal[0]), 0.0, np.empty((3, time.size))
    for k in range(time.size):
        current = GAIN * (270.0 * (goal[k] - q) + 30.0 * (rate[k] - v) + MOMENT * np.sin(q))
        for fine in range(round(LOG.period / FINE)):
            drive = current / GAIN - VISCOUS * v - MOMENT * np.sin(q)
            if v == 0.0 and abs(drive) <= COULOMB:
                acceleration = 0.0
            else:
                direction = np.sign(v) if v != 0.0 else np.sign(drive)
                acceleration = (drive - COULOMB * direction) / (ROTOR + LINK)
            if fine == 0:
                out[:, k] = q, current, LINK * acceleration + MOMENT * np.sin(q)
            faster = v + FINE * acceleration
            v = 0.0 if faster * v < 0.0 else faster
            q += FINE * v
    return out[0], out[1], out[2]


def run(shift: float, late: float) -> Run:
    """A log with a torque that is recorded `late` [s] after it was measured, and the noise of its sensor."""
    q, current, torque = simulated(shift)
    time = LOG.times()
    torque = np.interp(time - late, time, torque) + 0.1 * np.random.default_rng(round(10 * shift)).standard_normal(
        q.size
    )
    columns = {"joint/position": LOG.encoder(q, np.random.default_rng(0)), "joint/current": current}
    return LOG.run(f"run{shift}", columns | {"joint/torque": torque})


def diagnosed(late: float) -> JointResult:
    runs = [run(shift, late) for shift in (0.0, 0.7, 1.3)]
    return diagnose_joint(runs[:2], runs[2:], RIG, "joint", DiagnosisOptions(assess_residual=False))


@pytest.mark.parametrize("late", [0.03])
def test_the_report_says_by_how_much_and_friction_is_right(late):
    """A current that is held is half a period older than its sample, which makes the torque sensor seem less late."""
    found = diagnosed(late)
    (note,) = (each for each in found.notes if isinstance(each, TorqueRecordedLate))
    assert note.lead == pytest.approx(late, abs=LOG.period)
    assert found.effects == ()
    assert found.final_parameters["viscous"]["viscous"].value == pytest.approx(VISCOUS, rel=0.05)
    assert found.final_parameters["coulomb"]["coulomb"].value == pytest.approx(COULOMB, rel=0.05)
