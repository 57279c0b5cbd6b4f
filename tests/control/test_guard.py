"""CommandGuard: whatever comes in, what goes out is finite and within its limits; start, hold, damp, recover."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from numpy.testing import assert_allclose

from drake_tc.control.guard import RATE, RISE, START, UNBOUNDED, CommandGuard, GuardLaw, GuardMode, GuardSpec
from drake_tc.errors import ParamsError

DT = 1e-3
SPEC = GuardSpec(
    offset_limit=0.1,
    rate_limit=5.0,
    start_time=0.05,
    start_rate=5.0,
    hold_time=0.02,
    recover_time=0.01,
    blend_time=0.03,
)


class Driven:
    """A guard and its context, ticked by hand."""

    def __init__(self, n=2, spec=SPEC, servo=None):
        self.system = CommandGuard(n, DT, spec, servo)
        self.context = self.system.CreateDefaultContext()
        self.n = n

    def tick(self, command, position, fault=0.0):
        for name, value, size in (("command", command, self.n), ("position", position, self.n), ("fault", fault, 1)):
            self.system.GetInputPort(name).FixValue(self.context, np.full(size, 0.0) + value)
        y = np.array(self.system.GetOutputPort("command").Eval(self.context))
        mode = GuardMode(int(self.system.GetOutputPort("mode").Eval(self.context)[0]))
        self.context.SetDiscreteState(self.system.EvalUniquePeriodicDiscreteUpdate(self.context))
        return y, mode

    def run(self, ticks, command, position, fault=0.0):
        pairs = [self.tick(command, position, fault) for _ in range(ticks)]
        return np.array([y for y, _ in pairs]), [mode for _, mode in pairs]


anything = st.floats(allow_nan=True, allow_infinity=True, width=64)
usual = st.floats(-2.0, 2.0)
inputs = st.lists(
    st.tuples(
        arrays(float, 2, elements=st.one_of(usual, anything)),
        arrays(float, 2, elements=st.one_of(usual, anything)),
        st.one_of(st.sampled_from([0.0, 0.0, 0.0, 1.0]), anything),
        st.integers(1, 15),
    ),
    min_size=1,
    max_size=12,
)


@settings(max_examples=60, deadline=None)
@given(inputs=inputs, servo=st.sampled_from([None, (True, False), (False, False)]))
def test_finite_and_within_the_rate_whatever_comes(inputs, servo):
    law = GuardLaw(2, DT, SPEC, servo)
    state, started = law.initial(), False
    for command, position, fault, ticks in inputs:
        for _ in range(ticks):
            before = state
            state = np.empty(before.size)
            law.step(before, command, position, fault, state)
            assert np.all(np.isfinite(state))
            assert state[6] in (0.0, 1.0, 2.0, 3.0)
            if started:  # one unit in the last place of a large position
                assert np.all(np.abs(state[:2] - before[:2]) <= 5.0 * DT + 1e-9)
            started = state[-1] > 0.0


@settings(max_examples=50, deadline=None)
@given(
    steps=st.lists(st.tuples(st.floats(-1, 1), st.floats(-9, 9), st.booleans(), st.booleans()), min_size=5, max_size=80)
)
def test_close_to_a_joint_that_is_not_faster_than_the_rate(steps):
    law = GuardLaw(1, DT, SPEC)
    state, q = law.initial(), 0.3
    for move, command, fault, lost in steps:
        q += 5.0 * DT * move
        lost_command = np.array([np.nan if lost else command])
        before, state = state, np.empty(state.size)
        law.step(before, lost_command, np.array([q]), float(fault), state)
        assert abs(state[0] - q) <= 0.1 + 1e-12


def test_start_is_bumpless():
    guard = Driven()
    q = np.array([0.4, -0.2])
    y, modes = guard.run(80, q + np.array([0.05, -0.08]), q)
    assert np.all(np.abs(y[0] - q) < 1e-3)
    assert np.all(np.diff(np.abs(y - q), axis=0) >= -1e-12)  # monotone
    assert_allclose(y[60:], np.tile(q + np.array([0.05, -0.08]), (20, 1)), atol=1e-12)
    assert modes[0] == GuardMode.START
    assert modes.index(GuardMode.NORMAL) == 49
    assert np.max(np.abs(np.diff(y, 2, axis=0))) < 0.08 * 6 / 50**2 * 1.1  # smoothstep's largest curvature


def normal(guard=None, q=0.0):
    guard = Driven() if guard is None else guard
    _, modes = guard.run(60, q, q)
    assert modes[-1] == GuardMode.NORMAL
    return guard


def test_in_normal_mode_the_command_goes_through_at_once():
    guard = normal()
    y, _ = guard.tick([0.004, -0.003], 0.0)
    assert_allclose(y, [0.004, -0.003], rtol=1e-15)


def test_limits_of_step_and_offset():
    guard = normal()
    y, _ = guard.run(100, 3.0, 0.0)
    assert_allclose(y[0], 5.0 * DT)
    assert_allclose(y[-1], 0.1)


@pytest.mark.parametrize("how", ["fault", "command", "position", "nan_fault"])
def test_hold_then_damp_then_recover(how):
    guard = normal()
    guard.run(10, 0.03, 0.0)
    bad = {
        "fault": (0.9, 0.01, 1.0),
        "command": (np.array([np.nan, 0.0]), 0.01, 0.0),
        "position": (0.9, np.array([0.01, np.inf]), 0.0),
        "nan_fault": (0.9, 0.01, np.nan),
    }[how]
    y, modes = guard.run(20, *bad)
    assert set(modes) == {GuardMode.HOLD}
    assert_allclose(y, 0.03, rtol=1e-12)
    y, modes = guard.run(400, *bad)
    assert set(modes) == {GuardMode.DAMP}
    assert np.max(np.abs(np.diff(y, axis=0))) <= 0.5 * DT + 1e-12
    lost = how == "position"
    assert_allclose(y[-1], [0.01, 0.03] if lost else [0.01, 0.01], atol=1e-3)  # the joint without encoder holds on
    last = y[-1]
    y, modes = guard.run(100, 0.08, 0.01)
    assert modes[0] == GuardMode.DAMP
    assert modes.index(GuardMode.START) == 9  # recover_time
    assert modes[-1] == GuardMode.NORMAL
    steps = np.abs(np.diff(np.vstack([last, y]), axis=0))
    assert np.max(steps) < 0.09 * 1.5 / 30 * 1.1  # smoothstep's largest slope
    assert_allclose(y[-1], 0.08, rtol=1e-12)


def test_a_fault_that_returns_too_soon_keeps_holding():
    guard = normal(Driven(spec=GuardSpec(offset_limit=0.1, start_time=0.05, hold_time=1.0, recover_time=0.01)))
    guard.tick(0.0, 0.0, 1.0)
    for _ in range(5):
        _, modes = guard.run(8, 0.05, 0.0)
        assert set(modes) == {GuardMode.HOLD}
        guard.tick(0.05, 0.0, 1.0)


def test_a_position_that_is_wrong_is_not_followed():
    guard = normal()
    guard.run(10, 0.03, 0.0)
    y, modes = guard.run(300, 0.9, 0.08, 2.0)  # as if the encoders were off by 0.08 rad
    assert modes[-1] == GuardMode.DAMP
    assert_allclose(y, 0.03, rtol=1e-12)
    y, _ = guard.run(600, 0.9, 0.08, 1.0)  # a fault of another sensor: to the position
    assert_allclose(y[-1], 0.08, atol=2e-3)


def test_a_command_spoilt_in_the_tick_before_the_flag_is_taken_back():
    guard = normal()
    guard.run(10, 0.03, 0.0)
    spoilt, _ = guard.tick(0.03 + 0.004, 0.004)
    assert_allclose(spoilt, 0.034, rtol=1e-12)
    y, _ = guard.run(15, 0.034, 0.004, 2.0)
    assert_allclose(y, 0.03, rtol=1e-12)


def test_a_joint_left_behind_catches_up_at_the_start_rate():
    spec = GuardSpec(offset_limit=0.5, start_time=0.05, start_rate=1.0, hold_time=0.02, recover_time=0.01)
    guard = normal(Driven(1, spec))
    held, _ = guard.run(20, np.nan, 0.0)
    y, modes = guard.run(500, 0.4, 0.0)
    steps = np.diff(np.concatenate([held[-1], y[:, 0]]))
    assert steps.max() <= 1.0 * DT + 1e-12
    assert steps.min() >= 0.0
    met = modes.index(GuardMode.NORMAL)
    assert 0.4 / 1.0 <= met * DT < 0.4 / 1.0 + 0.1
    assert_allclose(y[met:], 0.4, rtol=1e-12)
    y, _ = guard.tick(0.41, 0.0)  # normal again: ten times the start rate goes through
    assert_allclose(y, 0.41, rtol=1e-12)


def test_damping_is_viscous():
    """A joint pushed at a small constant speed feels a lag of damp_time times the speed: effort = v damp_time."""
    spec = GuardSpec(hold_time=0.0, damp_time=0.05, damp_rate=1.0)
    guard = Driven(1, spec)
    guard.run(600, 0.0, 0.0)
    q = 0.0
    for _ in range(1000):
        q += 0.2 * DT
        y, mode = guard.tick(0.0, q, 1.0)
    assert mode == GuardMode.DAMP
    assert_allclose(q - y, 0.05 * 0.2, rtol=0.03)  # one step of 1/50 of damp_time
    followed = [y, *(guard.tick(0.0, q + 0.08, 1.0)[0] for _ in range(3))]
    assert_allclose(np.diff(followed, axis=0), 1.0 * DT, rtol=1e-9)  # viscous, it would be nearly twice as fast


def test_before_the_first_position_nothing_moves():
    guard = Driven()
    y, modes = guard.run(5, 0.3, np.array([np.nan, 0.2]))
    assert_allclose(y, 0.0)
    assert set(modes) == {GuardMode.HOLD}
    y, mode = guard.tick(0.3, 0.25)
    assert mode == GuardMode.START
    assert_allclose(y, 0.25, atol=1e-3)


def test_other_drives_rest_at_zero():
    guard = normal(Driven(2, SPEC, (True, False)), 0.0)
    y, _ = guard.run(100, 5.0, 2.0)
    assert_allclose(y[-1], [5.0 * DT * 100, 0.1])  # the servo follows its joint at the rate, the effort its limit
    y, _ = guard.run(600, 5.0, 0.5, 1.0)
    assert_allclose(y[-1], [0.5, 0.0], atol=1e-3)


@pytest.mark.parametrize("name", ["command", "position", "fault", "state"])
def test_poking_an_input_or_the_state_moves_the_outputs(name):
    guard = normal()
    system, context = guard.system, guard.context
    system.GetInputPort("command").FixValue(context, np.full(2, 0.004))
    command, mode = system.GetOutputPort("command"), system.GetOutputPort("mode")
    before = np.array(command.Eval(context))
    assert mode.Eval(context)[0] == GuardMode.NORMAL
    if name == "state":
        context.SetDiscreteState(system._law.initial())
    else:
        value = {"command": np.full(2, 0.005), "position": np.full(2, 3.0), "fault": np.ones(1)}[name]
        system.GetInputPort(name).FixValue(context, value)
    assert not np.array_equal(command.Eval(context), before)
    expected = {"fault": GuardMode.HOLD, "state": GuardMode.START}.get(name, GuardMode.NORMAL)
    assert mode.Eval(context)[0] == expected


def test_refusals():
    with pytest.raises(ParamsError, match=r"guard\.offset_limit: expected finite numbers > 0"):
        GuardSpec(offset_limit=0.0)
    with pytest.raises(ParamsError, match=r"guard\.start_rate: expected finite numbers > 0"):
        GuardSpec(start_rate=0.0)
    with pytest.raises(ParamsError, match=r"guard\.hold_time"):
        GuardSpec(hold_time=-1.0)
    with pytest.raises(ParamsError, match=r"guard\.rate_limit: expected one number or 2, got 3"):
        CommandGuard(2, DT, GuardSpec(rate_limit=(1.0, 2.0, 3.0)))
    with pytest.raises(ParamsError, match="servo: expected 2 flags"):
        CommandGuard(2, DT, SPEC, (True,))
    with pytest.raises(ParamsError, match="dt: expected a positive period"):
        CommandGuard(2, 0.0)
    with pytest.raises(ParamsError, match="at least one joint"):
        CommandGuard(0, DT)


def test_the_port_next_is_the_state_of_the_next_tick():
    guard = Driven()
    for command, position, fault in (
        ([0.3, 0.1], [0.2, 0.0], 0.0),
        ([0.4, 0.2], [np.nan, 0.0], 0.0),
        ([0.3, 0.1], 0.2, 1.0),
    ):
        for name, value, size in (("command", command, 2), ("position", position, 2), ("fault", fault, 1)):
            guard.system.GetInputPort(name).FixValue(guard.context, np.full(size, 0.0) + value)
        ahead = np.array(guard.system.GetOutputPort("next").Eval(guard.context))
        y, mode = guard.tick(command, position, fault)
        assert np.array_equal(ahead[:2], y) and ahead[6] == mode
        assert np.array_equal(guard.context.get_discrete_state_vector().value(), ahead)


def test_limits_of_drives_that_are_no_servos_do_not_depend_on_their_unit():
    """The rate is from 0 to the largest command in `RISE`, and nothing is limited where nothing is known."""
    spec = GuardSpec(offset_limit=(0.1, 300.0))
    offset, step, start_step, _ = GuardLaw(2, DT, spec, (True, False)).limits
    assert_allclose(offset, [0.1, 300.0])
    assert_allclose(step, [RATE * DT, 300.0 / RISE * DT])
    assert_allclose(start_step, [spec.start_rate * DT, 300.0 / RISE * DT])
    assert GuardLaw(2, DT, GuardSpec(), (True, False)).limits[0, 1] == UNBOUNDED
    assert GuardSpec().time_to_start((True, False)) == START
    assert GuardSpec().time_to_start((False, False)) == RISE
