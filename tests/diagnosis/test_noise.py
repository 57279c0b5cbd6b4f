"""Noise of the rows against dense covariances and processes whose correlation is known."""

from dataclasses import dataclass

import numpy as np
import pytest

from drake_tc.diagnosis.data.preparation import build_samples
from drake_tc.diagnosis.data.samples import Samples
from drake_tc.diagnosis.noise import NoiseModel, drawn_noise, fitted_noise, independent_share
from drake_tc.kernels.calls import Kernel
from drake_tc.logs.record import Run
from drake_tc.logs.rig import parse_rig
from drake_tc.types import FloatArray, IntArray

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
        columns = np.ascontiguousarray(values.reshape(values.shape[0], -1))
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
