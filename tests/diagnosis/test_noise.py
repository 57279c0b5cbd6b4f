"""Noise of the rows against dense covariances and processes whose correlation is known."""

from dataclasses import dataclass, replace

import numpy as np
import pytest
import scipy.signal

from drake_tc.diagnosis.data.preparation import build_samples
from drake_tc.diagnosis.data.samples import Samples
from drake_tc.diagnosis.diagnose import joint_model
from drake_tc.diagnosis.noise import (
    SPECTRUM,
    NoiseModel,
    Rows,
    _density,
    drawn_noise,
    fitted_noise,
    independent_share,
)
from drake_tc.diagnosis.problem.prepared import prepare_joint
from drake_tc.kernels.calls import Kernel
from drake_tc.logs.record import Run
from drake_tc.logs.rig import parse_rig
from drake_tc.types import FloatArray, IntArray
from tests.diagnosis.rigs import Joint, motion, record, rig_of

whiten = Kernel("filters", "whiten")


@dataclass
class PlainRows:
    """Rows that all count, at given distances, some of them at rest."""

    apart: FloatArray
    at_rest: FloatArray | float = 0.0
    moving: FloatArray | float = 0.0

    @property
    def index(self) -> IntArray:
        return np.arange(self.apart.size)

    def whitened(self, values: FloatArray, noise: NoiseModel) -> tuple[FloatArray, float]:
        return self.innovations(values.reshape(values.shape[0], -1), noise)

    def innovations(self, values: FloatArray, noise: NoiseModel) -> tuple[FloatArray, float]:
        columns = np.ascontiguousarray(values)
        out = np.empty_like(columns)
        white = np.full(self.apart.size, 1.0) + noise.rest * self.at_rest + noise.moving * self.moving
        return out, float(whiten(columns, self.apart, white, noise.ratio, noise.memory, out))


def _covariance(apart: FloatArray, ratio: float, memory: float, more: FloatArray | float = 0.0) -> FloatArray:
    """Of white noise of variance 1 + `more` and an Ornstein-Uhlenbeck process; it begins anew after an infinite gap."""
    run = np.cumsum(np.isinf(apart))
    time = np.cumsum(np.where(np.isinf(apart), 0.0, apart))
    same = run[:, None] == run[None, :]
    return np.diag(1.0 + more * np.ones(apart.size)) + ratio * same * np.exp(
        -np.abs(time[:, None] - time[None, :]) / memory
    )


def _apart(rng: np.random.Generator, size: int) -> FloatArray:
    apart = rng.uniform(0.01, 0.2, size)
    apart[[0, size // 3]] = np.inf
    return apart


@pytest.mark.parametrize(("ratio", "memory"), [(0.0, 1.0), (0.5, 0.1), (30.0, 2.0)])
def test_whitened_rows_have_the_determinant_and_the_products_of_the_dense_covariance(
    ratio: float, memory: float
) -> None:
    rng = np.random.default_rng(2)
    apart, values = _apart(rng, 60), rng.normal(size=(60, 3))
    at_rest = (np.arange(60) % 7 == 0).astype(float)
    covariance = _covariance(apart, ratio, memory, 5.0 * at_rest)
    white, log_determinant = PlainRows(apart, at_rest).whitened(values, NoiseModel(ratio, memory, rest=5.0))
    np.testing.assert_allclose(white.T @ white, values.T @ np.linalg.solve(covariance, values), rtol=1e-9, atol=1e-9)
    np.testing.assert_allclose(log_determinant, np.linalg.slogdet(covariance)[1], rtol=1e-9, atol=1e-9)


def test_the_fitted_noise_is_that_of_the_process() -> None:
    rng = np.random.default_rng(3)
    apart = _apart(rng, 1500)
    residual = np.linalg.cholesky(_covariance(apart, 10.0, 1.0)) @ rng.normal(size=1500)
    found = fitted_noise(PlainRows(apart), 0.01 * residual)  # type: ignore[arg-type]
    assert found.memory == 1.0
    assert 3.0 <= found.ratio <= 30.0  # the next steps of the grid


@pytest.mark.parametrize("ratio", [0.0, 3.0])
def test_noise_that_grows_with_the_speed_is_told_from_white_noise(ratio: float) -> None:
    rng = np.random.default_rng(7)
    apart = _apart(rng, 1500)
    speed2 = 2.0 * np.sin(np.arange(1500) / 20.0) ** 2  # of mean 1
    residual = np.linalg.cholesky(_covariance(apart, ratio, 0.3, 10.0 * speed2)) @ rng.normal(size=1500)
    rows = PlainRows(apart, moving=speed2)
    found = fitted_noise(rows, residual)  # type: ignore[arg-type]
    assert 3.0 <= found.moving <= 30.0  # the next steps of the grid
    assert fitted_noise(rows, rng.normal(size=1500)).moving <= 0.1  # type: ignore[arg-type]


@pytest.mark.parametrize("ratio", [0.0, 3.0])
def test_what_friction_leaves_near_rest_is_told_from_white_noise(ratio: float) -> None:
    rng = np.random.default_rng(5)
    apart, at_rest = _apart(rng, 1500), (np.arange(1500) % 50 < 5).astype(float)
    covariance = _covariance(apart, ratio, 0.3, 300.0 * at_rest)
    residual = np.linalg.cholesky(covariance) @ rng.normal(size=1500)
    assert fitted_noise(PlainRows(apart, at_rest), residual).rest == 300.0  # type: ignore[arg-type]
    assert fitted_noise(PlainRows(apart, at_rest), rng.normal(size=1500)).rest == 0.0  # type: ignore[arg-type]


def test_white_noise_is_fitted_as_white() -> None:
    rng = np.random.default_rng(4)
    apart = np.full(1500, 0.01)
    apart[0] = np.inf
    assert fitted_noise(PlainRows(apart), rng.normal(size=1500)).ratio <= 0.1  # type: ignore[arg-type]


def test_the_independent_share_is_that_of_an_autoregression() -> None:
    """x[k] = a x[k-1] + e[k] has 1 + 2 a/(1 - a) rows for one independent one."""
    rng, a = np.random.default_rng(6), 0.8
    values = np.zeros(20_000)
    for k, e in enumerate(rng.normal(size=values.size)):
        values[k] = a * values[k - 1] + e
    apart = np.full(values.size, 0.01)
    apart[0] = np.inf
    share = independent_share(PlainRows(apart), values)  # type: ignore[arg-type]
    assert share == pytest.approx((1.0 - a) / (1.0 + a), rel=0.15)


def test_the_drawn_noise_of_a_pendulum_s_load_is_that_between_two_logs_of_one_motion() -> None:
    """Two logs that differ in the encoder's noise alone; also of the slower load, which effects differentiate."""
    rig = parse_rig({"joint": "joint", "drive": "position_servo", "load": {"pendulum": {"mass": 1.5, "length": 0.3}}})
    time = np.arange(0.0, 20.0, 4e-3)
    motion = 0.6 * np.sin(2.0 * np.pi * 0.3 * time)

    def samples(seed: int) -> Samples:
        position = motion + 2e-4 * np.random.default_rng(seed).normal(size=time.size)
        columns = {"joint/position": position, "joint/position_command": motion + 0.01 * np.cos(motion)}
        run = Run("run", None, time, 4e-3, columns, np.zeros(time.size, dtype=int))
        return build_samples([run], rig, "joint", 0.05, 0.05)

    one, other = samples(1), samples(2)
    inner = slice(4 * one.light.margin, -4 * one.light.margin)
    drawn = drawn_noise(one, measured=False)[0].signals
    for name in ("load_torque", "slow_torque"):
        own, two, new = (getattr(each, name)[inner] for each in (one.signals, other.signals, drawn))
        assert np.std(new - own) == pytest.approx(np.std(two - own) / np.sqrt(2.0), rel=0.15)


def test_the_drawn_noise_of_a_goal_is_that_between_two_logs_of_one_motion(hold: float = 8e-3) -> None:
    """Two logs that differ in what is white of the goal, and in its age, which is any within the time of its hold.

    The estimate leaves out the largest twentieth of the differences, which may be steps, and so lies an eighth below.
    """
    rig = parse_rig({"joint": "joint", "drive": "position_servo", "load": {"pendulum": {"mass": 1.5, "length": 0.3}}})
    time = np.arange(0.0, 60.0, 4e-3)

    def moving(at: FloatArray) -> FloatArray:
        return np.asarray(0.6 * np.sin(2.0 * np.pi * 0.3 * at) + 0.1 * np.sin(2.0 * np.pi * 1.1 * at))

    def samples(seed: int) -> Samples:
        random = np.random.default_rng(seed)
        goal = moving(time - hold * random.random(time.size)) + 3e-4 * random.normal(size=time.size)
        position = moving(time - 0.01) + 1e-5 * np.random.default_rng(9).normal(size=time.size)
        columns = {"joint/position": position, "joint/position_command": goal}
        run = Run("run", None, time, 4e-3, columns, np.zeros(time.size, dtype=int))
        return build_samples([run], rig, "joint", 0.05, 0.05)

    one, other = samples(1), samples(2)
    inner = slice(4 * one.light.margin, -4 * one.light.margin)
    drawn = drawn_noise(one, measured=False)[1].signals
    own, two, new = (each.effort[inner] for each in (one.signals, other.signals, drawn))
    assert np.std(new - own) == pytest.approx(np.std(two - own) / np.sqrt(2.0), rel=0.13)


def test_a_turn_between_two_samples_counts_as_near_rest_by_the_squared_kernel() -> None:
    """Friction that turns at any instant within a period errs by a pulse, which both filters pass."""
    period, turn = 0.04, 400
    time = period * np.arange(800)
    columns = {
        "joint/position": np.pi * np.abs(time - time[turn] + 0.5 * period) + 1e-3 * np.sin(3.0 * time),
        "joint/current": np.sin(time),
    }
    columns["joint/torque"] = np.cos(time)
    run = Run("turn", None, time, period, columns, np.zeros(time.size, np.int64))
    rig = parse_rig({"joint": "joint", "drive": "current", "load": "torque", "declared": {"rotor_inertia": 0.1}})
    samples = build_samples([run], rig, "joint", width_s=0.16, final_s=0.16)
    rng, rows = np.random.default_rng(0), Rows(samples)
    kernel = np.convolve(samples.light.kernels[0], samples.kernel.kernels[0])
    drawn = np.zeros((2000, time.size))
    drawn[:, turn - 1] = rng.uniform(-0.5, 0.5, 2000)
    passed = np.array([np.convolve(each, kernel, "same") for each in drawn])[:, samples.rows]
    variance, near = passed.var(axis=0), rows.variances(NoiseModel(rest=1.0)) - 1.0
    assert np.corrcoef(variance, near)[0, 1] > 0.95
    far = np.abs(samples.rows - turn) > kernel.size
    assert near[far].max() < 1e-6 < near.max()


def test_a_shifted_torque_leaves_what_a_torque_in_time_leaves() -> None:
    """A split at the age of a late torque has the load of the log whose torque is in time."""
    joint, late = Joint(torque_noise=0.0, encoder_noise=0.0), 6e-3
    run, m = record(joint, "run", 0.4, 0), motion(joint, 0.4)
    steps = round(late / joint.period)
    delayed = np.concatenate([np.full(steps, m.tau[0]), m.tau[:-steps]])
    shifted = replace(run, columns={**run.columns, "joint/torque": delayed})
    models = [joint_model(prepare_joint([each], [each], rig_of(joint), "joint")) for each in (run, shifted)]
    theta = np.array([joint.viscous, joint.coulomb])
    there = models[1].relinearised(models[1].declared, theta, joint.gain, {"torque": late})
    again = there.relinearised(there.declared, theta, joint.gain, {"torque": late})
    both, own, other = np.intersect1d(models[0].train.samples.rows, there.train.samples.rows, return_indices=True)
    inner = (both > 100) & (both < len(m.tau) - 100)
    expected = models[0].train.recorded.target[own][inner]
    np.testing.assert_allclose(there.train.recorded.target[other][inner], expected, atol=1e-4 * np.std(expected))
    np.testing.assert_allclose(again.train.recorded.target, there.train.recorded.target, rtol=1e-12)


@pytest.mark.parametrize("size", [7, 60, 255, 256, 257, 1500])
def test_the_spectral_density_is_that_of_scipy(size: int) -> None:
    values = np.random.default_rng(size).normal(size=size)
    expected = scipy.signal.welch(values, 250.0, nperseg=min(size, SPECTRUM), nfft=SPECTRUM, detrend=False)[1]
    np.testing.assert_allclose(_density(values, 250.0), expected, rtol=1e-10, atol=1e-15)
