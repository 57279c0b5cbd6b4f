"""Play and dead zone told apart on a simulated stand: motor with friction, gear with a gap, servo with a dead zone."""

from dataclasses import dataclass

import numpy as np
import pytest
from numpy.testing import assert_allclose

from drake_tc.errors import IdentificationError
from drake_tc.logs.record import Run
from tests.benchmarks.backlash_bench import analyse_backlash, fit_drive_law

STEP = 2.0 * np.pi / 4096.0
DEGREE = np.pi / 180.0


@dataclass(frozen=True)
class Stand:
    """A servo on a stand; angles in rad, torques in N m, efforts in V."""

    gap: float = 0.8 * DEGREE
    compliance: float = 0.1 * DEGREE
    dead_zone: float = 1.0 * STEP
    gain: float = 60.0
    stiction: float = 0.45
    pull: float = 1.0


def stand_log(stand: Stand, cycles: int = 6, period: float = 0.1, substeps: int = 50) -> Run:
    """Own motion, pull right, pull left, ... : the motor stays while |u + T| is below a friction that grows with T."""
    script = []  # (seconds, own command, right puller, left puller)
    for k in range(cycles):
        sweep = (1.0 if k % 2 else -1.0) * 100 * STEP
        script += [(1.0, sweep, 0, 0), (1.2, 0.0, 0, 0)]
        for right in ((1, 0), (0, 1), (1, 0)) if k % 2 == 0 else ((0, 1), (1, 0), (0, 1)):
            script += [(0.7, 0.0, *right), (0.9, 0.0, 0, 0)]
    dt = period / substeps
    motor, rows, t = 0.0, [], 0.0
    out, pullers = 0.0, np.zeros(2)
    for seconds, own, *wanted in script:
        for k in range(round(seconds / dt)):
            pullers += np.clip(np.array(wanted, float) - pullers, -dt / 0.25, dt / 0.25)
            torque = stand.pull * (pullers[0] - pullers[1])
            if torque > 0:
                out = motor + 0.5 * stand.gap + stand.compliance * torque
            elif torque < 0:
                out = motor - 0.5 * stand.gap + stand.compliance * torque
            else:  # no torque: the output stays where it is, unless a flank takes it along
                out = np.clip(out, motor - 0.5 * stand.gap, motor + 0.5 * stand.gap)
            seen = np.round(out / STEP) * STEP
            error = own - seen
            effort = stand.gain * np.sign(error) * max(abs(error) - stand.dead_zone, 0.0)
            friction = stand.stiction + 1.2 * abs(torque)
            net = effort + torque
            if abs(net) > friction:
                motor += dt * 6.0 * (net - np.sign(net) * friction)
            if k % substeps == 0:
                rows.append((t, own, seen, effort, *wanted, *pullers))
            t += dt
    table = np.array(rows).T
    columns = {
        "held/position_command": table[1],
        "held/position": table[2],
        "held/voltage": table[3],
        "right/position_command": table[4],
        "left/position_command": table[5],
        "right/position": table[6],
        "left/position": table[7],
    }
    return Run("stand", None, table[0], period, columns, np.zeros(table[0].size, dtype=np.int64))


@pytest.mark.parametrize("gap", [0.4, 0.6, 0.8])
def test_play_is_the_gap_and_not_the_dead_zone(gap: float) -> None:
    report = analyse_backlash(stand_log(Stand(gap=gap * DEGREE)), "held", ("right", "left"))
    # one encoder step (0.088 deg) on each of the rests that make up the difference
    assert_allclose(report.play.value, gap * DEGREE, rtol=0.0, atol=1.0 * STEP)
    assert report.play.low <= gap * DEGREE <= report.play.high
    assert_allclose(report.wind_up.value, 0.1 * DEGREE, rtol=0.0, atol=0.5 * STEP)
    assert not report.lower_bound


def test_a_servo_that_drives_against_the_pull_leaves_a_lower_bound() -> None:
    report = analyse_backlash(stand_log(Stand(gap=1.5 * DEGREE)), "held", ("right", "left"))
    assert report.lower_bound
    assert 0.5 * DEGREE < report.play.value < 1.5 * DEGREE


@pytest.mark.parametrize("steps", [0.0, 1.0, 3.0])
def test_dead_zone_is_read_from_the_drive_whatever_the_gap(steps: float) -> None:
    for gap in (0.0, 0.8):
        law = fit_drive_law(stand_log(Stand(gap=gap * DEGREE, dead_zone=steps * STEP)), "held")
        # efforts are exact here, so the line's crossing is; the encoder's steps only bracket it
        assert_allclose(law.dead_zone, steps * STEP, rtol=0.0, atol=1e-6)
        assert_allclose(law.gain, 60.0, rtol=1e-6)


def test_a_wide_dead_zone_alone_is_no_play() -> None:
    report = analyse_backlash(stand_log(Stand(gap=0.0, dead_zone=4.0 * STEP)), "held", ("right", "left"))
    assert report.play.value < 1.0 * STEP
    assert report.servo_band is not None
    assert report.servo_band.value > 6.0 * STEP  # the servo alone leaves that much


def test_spans_are_what_the_mechanics_leave() -> None:
    report = analyse_backlash(stand_log(Stand()), "held", ("right", "left"))
    rests = {side: [p.loaded for p in report.pulls if p.puller == side] for side in ("right", "left")}
    assert report.loaded_span.value > report.unloaded_span.value > 0.0
    assert report.loaded_span.low <= np.mean(rests["right"]) - np.mean(rests["left"]) <= report.loaded_span.high


def test_refusals_say_what_was_wanted() -> None:
    run = stand_log(Stand(), cycles=2)
    still = dict(run.columns) | {"left/position_command": np.zeros(len(run))}
    with pytest.raises(IdentificationError, match="never pulls"):
        analyse_backlash(Run("still", None, run.time, run.period, still, run.segment), "held", ("right", "left"))
    stuck = dict(run.columns) | {"held/position": np.zeros(len(run))}
    with pytest.raises(IdentificationError, match="never moves"):
        fit_drive_law(Run("stuck", None, run.time, run.period, stuck, run.segment), "held")
