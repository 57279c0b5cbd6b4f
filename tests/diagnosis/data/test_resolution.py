"""What noise alone leaves: closed forms of the sawtooth of an encoder's steps and of correlated torque noise."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.testing import assert_allclose
from scipy.signal import lfilter

from drake_tc.diagnosis.data.preparation import build_samples
from drake_tc.diagnosis.data.resolution import (
    NoiseFloor,
    Resolution,
    light_width,
    quantisation_error,
)
from drake_tc.diagnosis.data.sensors import between_lines, sample_noise, scatter, white_noise
from drake_tc.diagnosis.problem.columns import Columns, Term
from drake_tc.effects.base import Signals
from drake_tc.effects.library import effect
from drake_tc.filtering.common_kernel import CommonKernel

from ..rigs import Joint, record, rig_of

PERIOD = 1e-3
STEP = 2.0 * np.pi / 4096
"""Of a 12-bit encoder [rad]."""
LIGHT = CommonKernel(0.03, PERIOD)
FINAL = CommonKernel(0.02, PERIOD)
SILENT = Resolution(position_step=0.0, position_noise=0.0, torque_noise=0.0, velocity_noise=0.0)


def ramp(speed: float, seconds: float = 20.0) -> Signals:
    """Constant speed [rad/s]; the load is not computed from the position."""
    time = np.arange(round(seconds / PERIOD)) * PERIOD
    zero, none = np.zeros_like(time), np.full_like(time, np.nan)
    return Signals(
        time=time,
        position=speed * time,
        velocity=speed + zero,
        acceleration=zero,
        load_torque=zero,
        expected_torque=zero,
        slow_torque=zero,
        effort=zero,
        command=zero,
        direction=zero + 1.0,
        travel=speed * time,
        load_slope=zero,
        temperature=none,
        motor_position=none,
        supply_voltage=none,
        known_torque=zero,
        period=PERIOD,
    )


def inner(signals: Signals) -> np.ndarray:
    """Rows (N,) whose filters owe nothing to an end."""
    edge = LIGHT.margin + FINAL.margin
    return np.arange(edge, len(signals) - edge)


def floor_of(resolution: Resolution, signals: Signals, *, servo: bool = False) -> NoiseFloor:
    return NoiseFloor.of(resolution, LIGHT, FINAL, signals, inner(signals), servo=servo)


@given(st.floats(-50.0, 50.0), st.floats(1e-5, 1e-1))
def test_rounding_errs_by_half_a_step_at_most_and_is_odd(position, step):
    error = quantisation_error(np.array([position, -position]), step)
    assert abs(error[0]) <= 0.5 * step * (1.0 + 1e-9)
    assert_allclose(error[1], -error[0], atol=1e-12)  # numpy rounds halves to even: odd there too
    assert_allclose((position + error[0]) / step, np.round((position + error[0]) / step), atol=1e-6)


@pytest.mark.parametrize("speed", [0.011, 0.023])
def test_an_encoder_at_constant_slow_speed_has_the_noise_of_a_sawtooth(speed):
    """e = -(d/pi) sum_n (-1)^n sin(n w t)/n, w = 2 pi v/d: each harmonic passes with the gain and with w^k."""
    step_noise = STEP / np.sqrt(12.0)
    resolution = replace(SILENT, position_step=STEP, position_noise=step_noise)
    floor = floor_of(resolution, ramp(speed))
    n = np.arange(1, 40)
    frequency = n * speed / STEP
    power = 0.5 * (STEP / (np.pi * n) * LIGHT.gain(frequency) * FINAL.gain(frequency)) ** 2
    omega = 2.0 * np.pi * frequency
    expected = [float(np.sum(power * omega ** (2 * k))) for k in (2, 1, 0)]
    # the sampled corners of the sawtooth alias, and 20 s hold no whole number of steps
    assert_allclose(np.diag(floor.encoder_gram), expected, rtol=0.02)
    assert floor.encoder_gram[0, 2] < 0.0  # acceleration and position are in opposite phase
    white = floor_of(replace(resolution, position_step=0.0), ramp(speed))
    assert floor.encoder_gram[2, 2] > 5.0 * white.encoder_gram[2, 2]  # what white noise of the size does not show


def test_noise_beside_the_steps_adds_to_the_replay():
    signals, extra = ramp(0.02), 3e-4
    stepped = replace(SILENT, position_step=STEP, position_noise=STEP / np.sqrt(12.0))
    both = replace(stepped, position_noise=float(np.hypot(extra, stepped.position_noise)))
    more = floor_of(both, signals).encoder_gram - floor_of(stepped, signals).encoder_gram
    alone = floor_of(replace(SILENT, position_noise=extra), signals).encoder_gram
    assert_allclose(more, alone, rtol=1e-6, atol=1e-9 * abs(alone).max())


@pytest.mark.parametrize("servo", [False, True])
@pytest.mark.parametrize("stepped", [False, True])
def test_the_floor_of_a_whole_log_is_what_its_noise_leaves(servo, stepped):
    """RMS of the balance's residual under the true coefficients, over what the floor says of them."""
    noise = {"encoder_step": STEP} if stepped else {"encoder_noise": 2e-4, "torque_noise": 0.2}
    kind = {"drive": "position_servo", "gain": 2e-3} if servo else {"drive": "current", "gain": 0.08}
    joint = Joint(period=PERIOD, duration=20.0, **kind, **noise)
    clean = replace(joint, encoder_step=0.0, encoder_noise=0.0, torque_noise=0.0)
    rig, terms = rig_of(joint), (Term(effect("viscous")), Term(effect("coulomb")))
    made = [build_samples([record(j, seed=3)], rig, "joint", width_s=0.05, final_s=0.05) for j in (joint, clean)]
    beta = np.array([1.0 / joint.gain, joint.viscous, joint.coulomb])
    rows = np.intersect1d(made[0].rows, made[1].rows)
    # the balance's own filter error at reversals is in both logs: the difference is noise alone
    left = []
    for samples in made:
        columns = Columns(samples)
        left.append((columns.target - columns.design(terms) @ beta)[np.isin(samples.rows, rows)])
    expected = made[0].floor.torque(1.0 / joint.gain, joint.viscous)
    # 20 s hold some 400 independent values of the filtered noise: 2 sigma of an RMS are 7 %. Steps are replayed on a
    # position that is known to within one of them: the size of the errors is right, their phases are not.
    assert_allclose(np.sqrt(np.mean((left[0] - left[1]) ** 2)), expected, rtol=0.15 if stepped else 0.08)


def test_correlated_torque_noise_leaves_what_kernel_and_autocorrelation_say():
    memory, sigma = 0.02, 0.7
    floor = floor_of(replace(SILENT, torque_noise=sigma, torque_correlation_time=memory), ramp(0.1))
    rho = np.exp(-PERIOD / memory)
    white = np.random.default_rng(5).standard_normal(2_000_000)
    noise = sigma * np.sqrt(1.0 - rho**2) * lfilter([1.0], [1.0, -rho], white)
    passed = FINAL.smooth(LIGHT.smooth(noise))[5000:]
    assert_allclose(np.sqrt(floor.torque_variance), np.std(passed), rtol=0.01)  # 1000 s: 4e4 correlation times
    white_floor = floor_of(replace(SILENT, torque_noise=sigma), ramp(0.1))
    assert floor.torque_variance > 10.0 * white_floor.torque_variance
    brief = floor_of(replace(SILENT, torque_noise=sigma, torque_correlation_time=1e-5), ramp(0.1))
    assert_allclose(brief.torque_variance, white_floor.torque_variance, rtol=1e-9)


@settings(max_examples=40)
@given(st.floats(0.1, 1e4), st.floats(0.0, 50.0), st.floats(0.0, 5.0), st.booleans())
def test_the_floor_is_the_root_of_its_parts(stiffness, viscous, inertia, servo):
    signals = replace(ramp(0.05, 3.0), rotor_inertia=0.3)
    resolution = Resolution(0.0, 1e-4, 0.2, 0.0, effort_step=0.01)
    floor = floor_of(resolution, signals, servo=servo)
    k = [np.convolve(LIGHT.kernels[d], FINAL.kernels[0]) for d in (2, 1, 0)]
    held = stiffness if servo else 0.0
    through_position = (0.3 + inertia) * k[0] + viscous * k[1] + held * k[2]
    variance = 0.2**2 * float(k[2] @ k[2]) + 1e-8 * float(through_position @ through_position)
    variance += (stiffness * 0.01) ** 2 / 12.0 * float(k[2] @ k[2])
    assert_allclose(floor.torque(stiffness, viscous, inertia), np.sqrt(variance), rtol=1e-9)


@given(st.floats(1e-6, 1e6), st.sampled_from([-1.0, 1.0]))
def test_white_noise_scales_with_the_unit_and_ignores_sign_and_slow_motion(scale, sign):
    values = np.random.default_rng(0).standard_normal(3000)
    whole = [slice(0, 3000)]
    size = white_noise(values, whole)
    assert_allclose(size, 1.0, rtol=0.06)  # median of 3000 absolute third differences
    assert_allclose(white_noise(sign * scale * values, whole), scale * size, rtol=1e-9)
    slow = 100.0 + 0.02 * np.arange(3000) + 1e-5 * np.arange(3000) ** 2
    assert_allclose(white_noise(values + slow, whole), size, rtol=1e-6)


def test_white_noise_does_not_reach_across_a_gap():
    values = np.concatenate([np.zeros(40), 50.0 * np.ones(40)])
    assert white_noise(values, [slice(0, 40), slice(40, 80)]) == 0.0
    assert white_noise(np.full(50, np.nan), [slice(0, 50)]) == 0.0


def test_a_noisier_encoder_asks_for_a_wider_kernel_within_its_limits():
    time = np.arange(8000) * PERIOD
    position, whole = 0.5 * np.sin(2.0 * np.pi * 0.8 * time), [slice(0, 8000)]
    widths = [light_width(position, noise, whole, PERIOD) for noise in (1e-9, 1e-5, 1e-4, 1e-2)]
    assert widths == sorted(widths)
    assert widths[0] == 0.012
    assert 0.060 <= widths[-1] < 0.060 * 1.25
    chosen = CommonKernel(widths[1], PERIOD)
    left = 1e-5 * np.sqrt(np.sum(chosen.kernels[2] ** 2))
    assert left < 0.04 * np.std(chosen.second_derivative(position)[200:-200])


@pytest.mark.parametrize("noise", [0.1, 0.2, 0.25, 0.3, 0.35, 0.4, 0.5, 0.6, 1.0, 3.0])
@pytest.mark.parametrize("swing", [0.0, 200.0], ids=["drifts", "swings"])
def test_noise_is_found_also_where_it_is_a_part_of_the_step(noise, swing):
    """By counting how far the readings are from what was read: noise and rounding together."""
    rng, time = np.random.default_rng(5), np.arange(15000.0)
    true = 37.3 + 1e-2 * time + swing * np.sin(1e-3 * time)
    read = np.round(true + rng.normal(0.0, noise, time.size))
    assert sample_noise(read, 1.0, [slice(0, read.size)]) == pytest.approx(np.std(read - true), rel=0.17)


@pytest.mark.parametrize("held", [2, 5])
def test_the_staircase_of_a_held_channel_is_not_noise(held):
    """A smooth command of 50 or 20 Hz on rows of 100 Hz; with noise, its low frequencies are those of the estimate."""
    rng = np.random.default_rng(0)
    time = np.arange(0.0, 60.0, 0.01 * held)
    smooth = np.sin(2.0 * np.pi * 0.3 * time)
    rows = np.repeat(smooth, held)
    whole = [slice(0, rows.size)]
    jump = np.max(np.abs(np.diff(smooth)))
    assert sample_noise(rows, 0.0, whole) < 0.01 * jump
    noise = np.repeat(rng.normal(0.0, jump, smooth.size), held)
    slow = np.convolve(noise, np.full(50, 1.0 / 50.0), mode="valid")
    expected = np.std(slow) * np.sqrt(50.0)
    assert sample_noise(rows + noise, 0.0, whole) == pytest.approx(expected, rel=0.15)


@pytest.mark.parametrize("rate", [200.0, 250.0])
def test_steps_of_a_controller_in_the_effort_are_not_noise(rate):
    """Commands of 100 Hz that a stiff loop follows in steps: a sawtooth that is as high as the speed is fast."""
    rng = np.random.default_rng(0)
    time = np.arange(0.0, 40.0, 1.0 / rate)
    speed = np.sin(2.0 * np.pi * 0.2 * time) + 0.4 * np.sin(2.0 * np.pi * 0.45 * time)
    steps = 0.5 * speed * (0.5 - np.mod(time * 100.0 + 1e-9, 1.0))
    values = speed + steps + rng.normal(0.0, 0.01, time.size)
    assert sample_noise(values, 0.0, [slice(0, time.size)]) == pytest.approx(0.01, rel=0.15)


def test_white_noise_of_a_short_channel_has_no_spectrum():
    values = np.random.default_rng(1).normal(0.0, 0.3, 200)
    assert between_lines([values]) == np.inf
    assert sample_noise(values, 0.0, [slice(0, 200)]) == pytest.approx(0.3, rel=0.2)


def test_a_goal_that_is_held_over_two_samples_does_not_scatter():
    """Its stairs are those that the servo follows; read at instants that drift against them, it scatters."""
    goal = np.repeat(np.sin(2.0 * np.pi * 0.8 * np.arange(10_000) * 2e-3), 2)
    assert scatter(goal, [slice(0, goal.size)]) < 1e-6
    read = np.random.default_rng(0).uniform(0.0, 2e-3, 5000)
    drifting = np.sin(2.0 * np.pi * 0.8 * (np.arange(5000) * 4e-3 - read))
    speed = 2.0 * np.pi * 0.8 / np.sqrt(2.0)
    assert scatter(drifting, [slice(0, 5000)]) == pytest.approx(speed * 2e-3 / np.sqrt(12.0), rel=0.15)


def test_the_motion_of_a_goal_in_a_slow_log_is_not_its_noise():
    time = np.arange(2000) * 0.05
    goal = 0.6 * np.sin(2.0 * np.pi * 0.7 * time) + 0.3 * np.sin(2.0 * np.pi * 0.31 * time)
    assert scatter(goal, [slice(0, time.size)]) < 2e-4
    noisy = goal + 2e-3 * np.random.default_rng(1).normal(size=time.size)
    assert scatter(noisy, [slice(0, time.size)]) == pytest.approx(2e-3, rel=0.15)


def test_stairs_of_a_goal_that_beat_with_the_log_are_lines_and_no_noise():
    """Goals of 500 Hz that are read at 400 Hz are 0, 0.5, 1 and 1.5 ms old in turn; beside them, noise is found."""
    time = np.arange(8000) / 400.0
    goal = np.sin(2.0 * np.pi * 0.8 * np.floor(time * 500.0 + 1e-9) / 500.0)
    whole = [slice(0, time.size)]
    error = goal - np.sin(2.0 * np.pi * 0.8 * (time - 0.75e-3))
    assert scatter(goal, whole) < 0.1 * np.std(error)
    noisy = goal + 1e-3 * np.random.default_rng(1).normal(size=time.size)
    assert scatter(noisy, whole) == pytest.approx(1e-3, rel=0.15)
