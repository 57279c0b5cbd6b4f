"""Sensors that fail in mid swing and in contact: flagged within 50 ms, joints bounded, torques limited, no NaN."""

from functools import cache

import numpy as np
import pytest
from sweeps import slow_but

from drake_tc.control.guard import RATE, GuardMode
from drake_tc.errors import ParamsError
from drake_tc.loops.torque.running import simulate_scenario
from drake_tc.registry import diagram_entry

from .fault_cases import BIASES, CASES, FLAGGED_WITHIN, LATE, FaultCase, run_case

SITUATIONS = {"swing": ("hrp2_leg", "brisk_swing", 0.9), "contact": ("hrp2_leg_contact", "brisk_force_sine", 0.8)}
MARGIN = 0.02
"""How far a joint may be off beyond what the reference itself goes on without it [rad]."""
SPEED = {"swing": 4.0, "contact": 0.6}
"""Of any joint from the fault on [rad/s]; the swing's own reference reaches 3.6 rad/s."""


@cache
def scenario(situation):
    diagram, name, _ = SITUATIONS[situation]
    return diagram_entry(diagram).scenario(name)


def outcome(situation, case, **changes):
    return run_case(scenario(situation).changed(**changes), case, SITUATIONS[situation][2])


def recording_index(result):
    """Of the first tick at which a flag may be up: the one after the fault's start."""
    return int(np.argmax(result.after)) + 1


ALL = {f"{situation}-{case.name}": (situation, case) for situation in SITUATIONS for case in CASES}


@pytest.mark.parametrize(
    "name", slow_but(ALL, "swing-encoder-frozen", "swing-imu-spikes", "contact-force_torque-biased")
)
def test_a_failing_sensor_is_flagged_and_the_robot_stays_safe(name):
    situation, case = ALL[name]
    result = outcome(situation, case)
    recording, after = result.recording, result.after
    assert not result.flagged_before
    assert result.flagged_after <= FLAGGED_WITHIN
    assert result.finite
    assert result.excess <= MARGIN
    assert np.abs(recording.velocity[after]).max() <= SPEED[situation]
    assert result.torque_share <= 0.5
    steps = np.abs(np.diff(recording["command"], axis=0))
    assert steps.max() <= RATE * scenario(situation).dt * (1.0 + 1e-9)
    modes = set(recording["mode"][after, 0].astype(int).tolist())
    assert {GuardMode.HOLD, GuardMode.DAMP} <= modes
    if case.kind != "dropped_20ms":  # never taken up again, and at rest
        assert recording["mode"][-1, 0] == GuardMode.DAMP
        assert np.abs(recording.velocity[-1]).max() < 0.05


@pytest.mark.parametrize("gain", [1.0, pytest.param(0.1, marks=pytest.mark.slow)])
@pytest.mark.parametrize(
    "sensor",
    ["imu", pytest.param("encoder", marks=pytest.mark.slow), pytest.param("force_torque", marks=pytest.mark.slow)],
)
def test_a_sensor_that_is_back_after_20_ms_is_taken_up_without_a_bump(sensor, gain):
    calm = scenario("swing").changed(duration=2.2)
    result = run_case(
        calm.changed(gains=calm.gains.__class__(k6=gain, k7=0.01 * gain)), FaultCase(sensor, "dropped_20ms"), 0.9
    )
    recording, guard = result.recording, calm.guard
    mode = recording["mode"][:, 0]
    again = int(np.flatnonzero((mode == GuardMode.START) & result.after)[0])
    assert recording.time[again] < 0.9 + 0.15
    assert mode[-1] == GuardMode.NORMAL
    catching_up = np.flatnonzero((mode == GuardMode.START) & result.after)
    steps = np.abs(np.diff(recording["command"], axis=0)).max(axis=1)
    assert steps[catching_up - 1].max() <= guard.start_rate * calm.dt * (1.0 + 1e-9)
    assert steps[again - 1 :].max() <= 2.0 * np.abs(np.diff(recording["reference"][:, :6], axis=0)).max()
    flagged = {recording.flag_names[k] for k in np.flatnonzero(recording["flags"].any(axis=0))}
    without_command = {"command/not_finite"} if sensor == "encoder" else set()  # there is none without positions
    assert flagged == {{"force_torque": "right_ankle"}.get(sensor, sensor) + "/missing"} | without_command
    size = np.abs(recording.tracking_error).max(axis=1)
    envelope = np.array([block.max() for block in np.array_split(size[again + 300 :], 8)])
    assert np.all(np.diff(envelope) < 5e-3)  # decays, down to the friction's own error
    undisturbed = np.abs(simulate_scenario(calm.changed(duration=1.4)).tracking_error).max()
    assert size[again] > 0.15  # the reference had gone on meanwhile
    assert size[-50:].max() < (2e-3 if gain == 1.0 else 2e-2)
    assert undisturbed < 5e-3


SMALLEST = [
    ("swing", "encoder", 3, 0.0032, 0.0028),
    ("contact", "encoder", 3, 0.0032, 0.0028),
    ("swing", "imu", 3, 0.54, 0.46),
    ("swing", "imu", 1, 0.053, 0.046),
    ("swing", "force_torque", 2, 22.0, 20.0),
    ("swing", "force_torque", 4, 4.4, 4.0),
    ("contact", "force_torque", 2, 104.0, 97.0),
    ("contact", "force_torque", 4, 20.8, 19.4),
]
"""(situation, sensor, channel, bias that is flagged in time with either sign, bias that is not)."""


@pytest.mark.slow
@pytest.mark.parametrize(("situation", "sensor", "channel", "seen", "unseen"), SMALLEST)
def test_smallest_biases_that_are_flagged_in_time(situation, sensor, channel, seen, unseen):
    start = SITUATIONS[situation][2]

    def flagged_after(bias):
        return outcome(situation, FaultCase(sensor, "biased", bias, channel), duration=start + 0.06).flagged_after

    assert flagged_after(seen) <= FLAGGED_WITHIN
    assert flagged_after(-seen) <= FLAGGED_WITHIN
    assert flagged_after(unseen) > FLAGGED_WITHIN


def test_the_cases_biases_are_large_enough_to_be_seen():
    needed = {(sensor, channel): seen for _, sensor, channel, seen, _ in sorted(SMALLEST, key=lambda row: row[3])}
    compared = {
        sensor: (abs(bias), needed[sensor, at]) for sensor, (bias, at) in BIASES.items() if (sensor, at) in needed
    }
    assert compared
    assert {sensor for sensor, (bias, seen) in compared.items() if bias < seen} == set()


@pytest.mark.slow
def test_a_force_that_jumped_in_contact_is_not_believed_again():
    """A false 150 N: the force loop would balance it with the joints' stiffness, up to 0.13 rad at the knee."""
    result = outcome("contact", FaultCase("force_torque", "biased", 150.0))
    recording, jump = result.recording, recording_index(result)
    flag = recording.flag_names.index("right_ankle/jump")
    assert recording["flags"][jump:, flag].all()
    assert result.excess < 1e-3
    true = recording["force_torque"][:, 2] - 150.0 * result.after
    assert abs(true[-1] - true[jump - 10]) < 40.0


@pytest.mark.slow
@pytest.mark.parametrize("bias", [2.8e-3, -2.8e-3])
@pytest.mark.parametrize("situation", SITUATIONS)
def test_an_encoder_bias_too_small_to_be_seen_stays_bounded(situation, bias):
    result = outcome(situation, FaultCase("encoder", "biased", bias))
    assert result.finite
    assert result.flagged_after == np.inf
    assert result.excess < 6e-3
    assert result.torque_share <= 0.5


def test_a_faultless_run_raises_no_flag():
    for situation in SITUATIONS:
        recording = simulate_scenario(scenario(situation))
        assert not recording["flags"].any()
        assert recording["mode"][-1, 0] == GuardMode.NORMAL


@cache
def undisturbed(situation):
    return simulate_scenario(scenario(situation).changed(log_truth=True))


@pytest.mark.parametrize("age", [5e-3, *(pytest.param(age, marks=pytest.mark.slow) for age in (1e-2, 2e-2))])
def test_encoders_of_a_swinging_leg_that_come_late_are_flagged(age):
    """The readings jump back by the way of that time."""
    result = outcome("swing", FaultCase("encoder", LATE, age))
    assert result.finite and not result.flagged_before
    assert result.flagged_after <= FLAGGED_WITHIN
    assert result.excess <= 0.02
    assert result.recording["mode"][-1, 0] == GuardMode.DAMP


UNHARMED = [
    ("swing", "encoder", 0.003),
    ("swing", "imu", 0.01),
    ("contact", "force_torque", 0.01),
    ("swing", "force_torque", 0.01),
    ("contact", "encoder", 0.01),
    ("contact", "imu", 0.01),
]
"""Where readings of before hardly differ from those of now."""


@pytest.mark.slow
@pytest.mark.parametrize(("situation", "sensor", "age"), UNHARMED)
def test_a_sensor_that_comes_a_little_late_does_no_harm(situation, sensor, age):
    result, calm = outcome(situation, FaultCase(sensor, LATE, age)), undisturbed(situation)
    assert result.finite and result.flagged_after == np.inf
    assert np.abs(result.recording.tracking_error).max() <= 1.2 * np.abs(calm.tracking_error).max()
    assert np.abs(result.recording["joint_torque"]).max() <= 1.2 * np.abs(calm["joint_torque"]).max()


@pytest.mark.slow
def test_a_late_force_that_no_flag_tells():
    """A monitor that told this fault would make this test fail; see diagrams/limits.md."""
    contact = outcome("contact", FaultCase("force_torque", LATE, 0.02))
    assert contact.flagged_after == np.inf and contact.finite
    assert np.abs(contact.recording["joint_torque"]).max() == pytest.approx(94.0, rel=0.2)


def test_unknown_cases_are_refused():
    with pytest.raises(ParamsError, match="no sensor 'gps'; possible: encoder, imu, force_torque"):
        FaultCase("gps", "nan")
    with pytest.raises(ParamsError, match="no kind 'slow'; possible: frozen, dropped_20ms"):
        FaultCase("imu", "slow")
    with pytest.raises(ParamsError, match=r"channels: expected 0 to 5, got 6"):
        outcome("swing", FaultCase("encoder", "nan", channel=6))
