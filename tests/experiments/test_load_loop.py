"""The loop closed with known loads on simulated joints: which cases count, what a hung mass is, and that it decides."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose

from drake_tc.experiments.design.loads import KnownLoad
from drake_tc.experiments.rehearsal.twin import TwinRun, integrated, on_clock
from drake_tc.types import GRAVITY
from tests.benchmarks.evidence.load_loop import LoadCase, hung, load_rows, run_load_cases
from tests.benchmarks.evidence.pairs import LOAD_PAIRS, drawn_joint


def test_a_case_counts_where_the_first_logs_leave_it_open_and_the_loads_promise_to_decide_it():
    case = LoadCase("delay", "backlash", 1, "open", "other", "truth", 0.1, 0.95)
    cases = [case, replace(case, loaded="open"), replace(case, predicted=0.2), replace(case, first="truth")]
    cases.append(LoadCase("delay", "backlash", 1, "open", refusal="the same function", loads_refusal="no load helps"))
    values = {row.name: row.value for row in load_rows(cases)}
    assert [row.value for row in load_rows(cases)][:5] == [5, 4, 1, 1, 2]
    assert values["predicted at or above: separated with loads"] == 0.5
    assert values["predicted at or above: separated by the designed run without loads"] == 0.0
    assert values["predicted below: separated with loads"] == 1.0


@pytest.mark.parametrize("number", [2, 4])
def test_a_hung_mass_turns_the_simulated_joint_as_a_pendulum_would(number):
    """The torque through the gear is (J_l + m r^2) qddot + (G + m g r) sin q."""
    pair = LOAD_PAIRS[number]
    spec, load = drawn_joint(pair, pair.first, 9).spec, KnownLoad(3.0, 0.4)
    time = np.arange(0.0, 6.0, 1e-3)
    run = TwinRun("run", on_clock(time, 0.5 * np.sin(2.0 * time), np.zeros_like(time)), time)
    (record,) = integrated([hung(spec, load)], [run])
    q, acceleration = record.channels["position"], record.channels["acceleration"]
    need = (spec.joint.link_inertia + 3.0 * 0.16) * acceleration
    need += (spec.joint.gravity + 3.0 * GRAVITY * 0.4) * np.sin(q)
    assert record.spec.joint.gravity == pytest.approx(spec.joint.gravity + 3.0 * GRAVITY * 0.4)
    assert_allclose(record.channels["torque"], need, atol=1e-6 * np.abs(need).max())


@pytest.mark.slow
def test_loads_decide_pairs_that_motions_leave_open():
    """Torque sensor or drive, spring or payload: the first logs and the designed run without loads leave them open."""
    cases = run_load_cases([LOAD_PAIRS[0], LOAD_PAIRS[2]], seed=11)
    promised = [case for case in cases if case.promised]
    assert len(promised) >= 2
    assert all(case.loaded == "truth" for case in promised), cases
    assert any(case.unloaded != "truth" for case in promised), cases
