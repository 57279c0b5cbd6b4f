"""Three sensors a joint: the one that is wrong is found out and replaced by the other two."""

from dataclasses import replace
from typing import NamedTuple

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.testing import assert_allclose, assert_array_equal

from drake_tc.estimation.link_position import LinkPosition
from drake_tc.kernels.joint_voting import TAU, THETA, Q, past_of, remember
from drake_tc.kernels.joint_voting import vote as vote_of
from drake_tc.sensing.sensor import SensorSpec, corrupt
from drake_tc.sensing.spec import SensorFault
from drake_tc.sensor_validation.joint_sensors import FLAGS, GAUGE_REPEATS, HISTORY, LINK_REPEATS, ROWS, JointSensors

DT = 1e-3
C, TIME = np.array([0.005, 1.0 / 120.0]), np.array([1.2e-3, 0.7e-3])
START = 0.3
NAMES = {"motor_encoder": THETA, "gauge": TAU, "encoder": Q}


def joints(seconds=0.8):
    """(T, 3, 2) true theta, tau, q: a joint that moves at 4 rad/s, one that hardly does, springs with damping."""
    t = DT * np.arange(round(seconds / DT))
    q = np.stack([0.64 * np.sin(6.3 * t), 0.004 * np.sin(5.0 * t)], axis=1)
    d = np.stack([0.05 + 0.03 * np.sin(8.0 * t), 0.06 + 0.01 * np.cos(6.0 * t)], axis=1)
    rate = np.diff(d, axis=0, prepend=d[:1]) / DT
    return np.stack([q + d, (d + TIME * rate) / C, q], axis=1)


def readings(truth, **faults):
    """With the loop's own noise and resolution; faults by sensor."""
    specs = {
        "motor_encoder": SensorSpec(resolution=1.534e-5),
        "gauge": SensorSpec(noise=0.02),
        "encoder": SensorSpec(noise=1e-5, resolution=1e-5),
    }
    rows = [
        corrupt(truth[:, row], specs[name], DT, faults.get(name, ()), seed=row) for row, name in enumerate(NAMES.keys())
    ]
    return np.stack(rows, axis=1)


class Voted(NamedTuple):
    """A tick: where a sensor is missing, frozen or odd (3, n), where two are wrong (n,); the memory (ROWS, n)."""

    missing: np.ndarray
    frozen: np.ndarray
    odd: np.ndarray
    lost: np.ndarray
    memory: np.ndarray


def voted(y, compliance=C, time=TIME):
    """All votes, and what was given (T, 3, n)."""
    n, repeats = y.shape[2], np.array([np.inf, GAUGE_REPEATS, LINK_REPEATS])
    springs, votes, out = np.array([compliance, DT / (DT + time)]), [], []
    state, past, flags = np.zeros(ROWS * n + 1), np.zeros((HISTORY, 3 * n)), np.zeros((3, max(n, len(FLAGS))))
    for row in y:
        after, given_, found = np.zeros(ROWS * n + 1), np.zeros((4, n)), np.zeros((10, n))
        well = vote_of(tuple(np.ascontiguousarray(row)), (state, past), springs, repeats, (after, given_, found))
        marks = found > 0.0
        votes.append(Voted(marks[:3], marks[3:6], marks[6:9], marks[9], after[:-1].reshape(ROWS, n)))
        assert well == (not marks.any())
        out.append(given_[:3])
        remember((after, found), 100.0, (state, past, flags[0, : len(FLAGS)], flags[1, : len(FLAGS)], flags[2, :n]))
    return votes, np.array(out)


def test_sound_readings_go_through_bit_by_bit():
    y = readings(joints(3.0))
    votes, given_ = voted(y)
    assert_array_equal(given_, y)
    assert not any(vote.odd.any() or vote.missing.any() or vote.frozen.any() for vote in votes)


def test_the_past_is_the_readings_of_the_ticks_before():
    y, n = readings(joints(0.25)), 2
    state, past, flags = np.zeros(ROWS * n + 1), np.zeros((HISTORY, 3 * n)), np.zeros((3, len(FLAGS)))
    springs, repeats = np.array([C, DT / (DT + TIME)]), np.full(3, np.inf)
    raw, deflection = [], C * y[0, TAU]
    for ticks, row in enumerate(y):
        after, found = np.zeros(ROWS * n + 1), np.zeros((10, n))
        vote_of(tuple(np.ascontiguousarray(row)), (state, past), springs, repeats, (after, np.zeros((4, n)), found))
        deflection = deflection + springs[1] * (C * row[TAU] - deflection)
        raw.append([row[THETA], deflection.copy(), row[Q]])
        ages = np.maximum(ticks - np.arange(HISTORY), 0)
        for j in range(n):
            seen = past_of(past, ticks, after[:-1].reshape(ROWS, n), j)
            assert_array_equal(seen, np.array(raw)[ages, :, j].T)
        remember((after, found), 100.0, (state, past, flags[0], flags[1], flags[2, :n]))
    assert len(y) > 2 * HISTORY


FAULTS = {
    "frozen": SensorFault("frozen", START),
    "dropped": SensorFault("dropped", START),
    "dropped_20ms": SensorFault("dropped", START, 0.02),
    "nan": SensorFault("nan", START, channels=(0,)),
    "spikes": SensorFault("spikes", START, value=0.05),
    "biased": SensorFault("biased", START, channels=(0,), value=0.05),
}
LATE = {"motor_encoder-frozen": 0.3, "encoder-frozen": 0.025}
"""An encoder before the spring that freezes while its joint hardly moves is seen when the joint has moved [s]."""


@pytest.mark.parametrize("kind", FAULTS)
@pytest.mark.parametrize("name", NAMES)
def test_any_one_of_three_is_found_out_and_replaced(name, kind):
    truth, fault = joints(), FAULTS[kind]
    if name == "gauge" and kind in ("spikes", "biased"):
        fault = replace(fault, value=5.0)
    y = readings(truth, **{name: [fault]})
    votes, given_ = voted(y)
    first = next(k for k, vote in enumerate(votes) if (vote.missing | vote.frozen | vote.odd).any())
    at, row = round(START / DT), NAMES[name]
    assert first >= at
    assert first - at <= (2 if kind not in ("frozen", "spikes") else 30)
    for vote in votes:
        others = np.delete([vote.missing, vote.frozen, vote.odd], row, axis=1)
        assert not others.any()
        assert not vote.lost.any()
    wrong = np.abs(given_ - truth)
    settled = slice(at + round(LATE.get(f"{name}-{kind}", 0.01) / DT), None)
    # position error: what may go unseen, 1 mrad and 5 % of 0.1 rad of deflection
    assert wrong[:, [THETA, Q]].max() < 7e-3
    if kind != "frozen":  # a frozen one is off by what the joint moves before it is found out, as above
        assert wrong[settled][:, [THETA, Q]].max() < 2e-3
    assert wrong[settled][:, TAU].max() < (0.1 if name != "gauge" or kind != "frozen" else 0.2)


def test_an_encoder_frozen_at_a_joint_that_hardly_moves_is_not_laid_to_the_gauge():
    """So slow that the encoder behind the spring repeats itself too, for a few ticks at a time."""
    n, t = 40, DT * np.arange(1000)
    c, time = np.tile(C, n // 2), np.tile(TIME, n // 2)
    d = 0.03 + np.outer(t, np.linspace(0.005, 0.01, n))
    q = np.full_like(d, 0.1)
    rate = np.diff(d, axis=0, prepend=d[:1]) / DT
    truth = np.stack([q + d, (d + time * rate) / c, q], axis=1)
    votes, given_ = voted(readings(truth, motor_encoder=[SensorFault("frozen", START)]), c, time)
    odd = np.array([vote.odd for vote in votes])
    assert odd[:, THETA].any(axis=0).all()
    assert not odd[:, [TAU, Q]].any()
    assert np.abs(given_ - truth)[:, [THETA, Q]].max() < 3.5e-3  # 1 mrad and 5 % of 0.04 rad, and noise


def test_a_gauge_that_fails_is_replaced_by_the_encoders_better_than_it_was():
    truth = joints()
    _, given_ = voted(readings(truth, gauge=[SensorFault("dropped", START)]))
    late = slice(round(START / DT), None)
    spread = np.std(given_[late, TAU] - truth[late, TAU], axis=0)
    step = np.hypot(1e-5 * np.sqrt(1.0 + 1.0 / 12.0), 1.534e-5 / np.sqrt(12.0))  # of theta - q: noise and two grids
    share = DT / (DT + TIME)  # tau = (d[k]/s - (1/s - 1) d[k-1])/c
    assert_allclose(spread, step * np.sqrt(share**-2 + (1.0 / share - 1.0) ** 2) / C, rtol=0.1)


def test_it_is_believed_again_once_it_agrees():
    y = readings(joints(), motor_encoder=[SensorFault("biased", START, 0.05, value=0.05)])
    votes, given_ = voted(y)
    back = round((START + 0.05) / DT) + 20
    assert_array_equal(given_[back:], y[back:])
    assert votes[back - 5].memory[ROWS - 4 : ROWS - 1].max() > 0.0  # but not at once


def test_two_of_three_lost_hold_what_they_had():
    truth = joints()
    lost = SensorFault("dropped", START)
    votes, given_ = voted(readings(truth, motor_encoder=[lost], encoder=[lost]))
    at = round(START / DT)
    assert np.isfinite(given_).all()
    assert votes[-1].lost.all()
    assert_array_equal(given_[at:, Q], np.tile(given_[at, Q], (len(given_) - at, 1)))
    assert_allclose(given_[at, Q], truth[at - 1, Q], atol=1e-4)


NUMBERS = st.floats(allow_nan=True, allow_infinity=True, width=64)


@settings(max_examples=60, deadline=None)
@given(st.lists(st.tuples(*[NUMBERS] * 6), min_size=1, max_size=5))
def test_any_numbers_in_finite_numbers_out(rows):
    _, given_ = voted(np.array(rows).reshape(-1, 3, 2))
    assert np.isfinite(given_).all()


def step(system, context):
    after = system.EvalUniquePeriodicDiscreteUpdate(context)
    context.SetTime(context.get_time() + DT)
    for group in range(after.num_groups()):
        context.SetDiscreteState(group, np.array(after.value(group)))


def test_the_system_is_the_vote_and_its_flags_say_which():
    y = readings(joints(), gauge=[SensorFault("frozen", START, 0.1)], encoder=[SensorFault("nan", 0.6, channels=(1,))])
    votes, given_ = voted(y)
    system = JointSensors(C, TIME, DT)
    context, names, up = system.CreateDefaultContext(), ("motor_angle", "torque", "link_angle"), []
    link = LinkPosition(C, TIME, DT)
    beside = link.CreateDefaultContext()

    def follow(theta, tau):
        link.GetInputPort("motor_angle").FixValue(beside, theta)
        link.GetInputPort("torque").FixValue(beside, tau)
        found = link.GetOutputPort("position").Eval(beside).copy()
        step(link, beside)
        return found

    for k, row in enumerate(y):
        for name, value in zip(names, row, strict=True):
            system.GetInputPort(name).FixValue(context, value)
        got = [system.GetOutputPort(name).Eval(context) for name in names]
        assert_array_equal(got, given_[k])
        assert_allclose(system.GetOutputPort("position").Eval(context), given_[k, Q], atol=1e-3)
        reference = follow(given_[k, THETA], given_[k, TAU])
        assert_allclose(system.GetOutputPort("position").Eval(context), reference, atol=2e-4 * (k > 300) + 1e-12)
        up.append(system.GetOutputPort("flags").Eval(context))
        step(system, context)
    up = np.array(up)
    raised = {FLAGS[i]: np.flatnonzero(up[:, i]) for i in np.flatnonzero(up.any(axis=0))}
    assert set(raised) == {"gauge/frozen"}  # a missing encoder behind the spring is the monitor's
    first = round(START / DT) + 6
    assert raised["gauge/frozen"][0] == first  # the sixth repeat is at START + 5 ticks, the flag a tick later
    assert raised["gauge/frozen"][-1] == round((START + 0.1) / DT) + 99
    assert len(votes) == len(up)


def test_link_position_holds_the_last_good_one():
    system = LinkPosition(C, TIME, DT)
    context = system.CreateDefaultContext()
    ports = [system.GetOutputPort(name) for name in ("position", "fault")]

    def given_to(angle, torque):
        system.GetInputPort("motor_angle").FixValue(context, angle)
        system.GetInputPort("torque").FixValue(context, torque)
        found = [port.Eval(context) for port in ports]
        step(system, context)
        return found

    position, fault = given_to([np.nan, 1.0], [0.0, 12.0])
    assert_allclose(position, [0.0, 1.0 - 0.1], rtol=1e-12)
    assert_array_equal(fault, [1.0, 0.0])
    position, fault = given_to([0.5, 1.2], [4.0, np.inf])
    assert_allclose(position, [0.5 - C[0] * 4.0 * DT / (DT + TIME[0]), 0.9], rtol=1e-12)  # d was 0
    assert_array_equal(fault, [0.0, 1.0])


def test_the_joint_that_has_lost_two_sensors_is_named_and_no_other():
    system = JointSensors(C, TIME, DT)
    context = system.CreateDefaultContext()
    y = readings(
        joints(0.5),
        motor_encoder=(SensorFault("dropped", 0.2, channels=(1,)),),
        encoder=(SensorFault("dropped", 0.3, channels=(1,)),),
    )
    lost = []
    for row in y:
        for name, values in zip(("motor_angle", "torque", "link_angle"), row, strict=True):
            system.GetInputPort(name).FixValue(context, values)
        lost.append(system.GetOutputPort("lost").Eval(context).copy())
        after = system.EvalUniquePeriodicDiscreteUpdate(context)
        for group in range(after.num_groups()):
            context.SetDiscreteState(group, np.array(after.value(group)))
    lost = np.array(lost)
    assert_array_equal(lost[:, 0], np.zeros(len(y)))
    assert_array_equal(lost[:, 1], np.arange(len(y)) > 300)


def from_rest(hertz: float, seconds=1.5):
    """(T, 3, 2) true theta, tau, q: both joints stand until `START`, then swing ever faster up to a frequency."""
    t = np.maximum(DT * np.arange(round(seconds / DT)) - START, 0.0)
    phase = 2.0 * np.pi * hertz * np.minimum(t, 0.5) * t
    q = np.outer(np.sin(phase), [0.1, 0.05])
    d = 0.04 + np.outer(np.sin(1.3 * phase), [0.02, -0.03])
    rate = np.diff(d, axis=0, prepend=d[:1]) / DT
    return np.stack([q + d, (d + TIME * rate) / C, q], axis=1)


@pytest.mark.parametrize("hertz", [2.0, 8.0])
@pytest.mark.parametrize("delay", [0.01, 0.02, 0.03])
@pytest.mark.parametrize("name", NAMES)
def test_a_late_sensor_is_told_from_the_two_that_are_not(name, delay, hertz):
    """What is given is the truth from then on, but for what may go unseen: 1 mrad and 5 % of the deflection.

    A gauge shows its spring's damping too.
    """
    truth = from_rest(hertz)
    votes, given_ = voted(readings(truth, **{name: [SensorFault("late", 0.1, value=delay)]}))
    row = NAMES[name]
    odd = np.array([vote.odd for vote in votes])
    found = np.flatnonzero(odd[:, row].any(axis=1))[0]
    settled = slice(found + 100, None)
    # at 10 Hz and 30 ms, two radians of phase, another sensor is suspected for less than a period of the doubt
    assert np.delete(odd[settled], row, axis=1).any(axis=(1, 2)).sum() < 20
    wrong = np.abs(given_ - truth)[settled]
    assert wrong[:, [THETA, Q]].max() < 1.5e-3 + 0.05 * 0.07
    assert (C * wrong[:, TAU]).max() < 1.5 * (1.5e-3 + 0.05 * 0.07)


@pytest.mark.parametrize("hertz", [0.5, 2.0, 8.0])
@pytest.mark.parametrize("name", ["motor_encoder", "encoder"])
def test_an_encoder_that_freezes_in_a_swing_is_not_taken_for_another_one_that_is_late(name, hertz):
    truth = from_rest(hertz)
    votes, given_ = voted(readings(truth, **{name: [SensorFault("frozen", 0.8)]}))
    odd = np.array([vote.odd | vote.frozen for vote in votes])
    assert odd[:, NAMES[name]].any(axis=0).all()
    assert not np.delete(odd, NAMES[name], axis=1).any()
    assert np.abs(given_ - truth)[:, [THETA, Q]].max() < 7e-3


def test_a_gauge_that_drifts_at_a_joint_of_constant_speed_is_not_called_a_late_encoder():
    """At constant speed an offset and a delay look the same; encoders are believed then."""
    t = DT * np.arange(1200)
    q, d = np.outer(t, [0.5, 0.5]), np.full((t.size, 2), 0.04)
    truth = np.stack([q + d, d / C, q], axis=1)
    y = readings(truth)
    y[:, TAU] += np.outer(np.maximum(t - START, 0.0), [6.0, -6.0])
    votes, given_ = voted(y)
    odd = np.array([vote.odd for vote in votes])
    assert odd[:, TAU].any(axis=0).all()
    assert not odd[:, [THETA, Q]].any()
    assert np.abs(given_ - truth)[:, [THETA, Q]].max() < 1e-3 + 0.05 * 0.09
