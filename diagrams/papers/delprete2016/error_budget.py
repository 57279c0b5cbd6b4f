"""The error budget of the torque estimate: which imperfection costs how much, joint by joint.

The estimate is made many times from the same motion, each time with one imperfection switched on:

    contribution = estimate(truth's sensors with it, smoothed) - estimate(truth's sensors, smoothed)

except "filter smoothing" and "filter lag", which are what the filters do to perfect sensors, and "total", which is the
estimate with everything on, late as it is, against the true torque of the same instant. Contributions that are
independent add up as squares: the root of their sum is beside the total, and a difference between them tells of
errors that work together.
"""

from collections.abc import Mapping
from dataclasses import dataclass, fields, replace
from typing import Any, NamedTuple

import numpy as np

from drake_tc.errors import ParamsError
from drake_tc.estimation.torque_model import TorqueModel
from drake_tc.filtering.savitzky_golay import Smoothed, smooth, smooth_causal
from drake_tc.sensing.spec import SensorSpec
from drake_tc.sensing.suite import SensorSuiteSpec
from drake_tc.types import FloatArray


@dataclass(frozen=True, eq=False)
class Run:
    """A recorded run's truth: T samples, n joints, k F/T sensors.

    Attributes:
        position: (T, n) [rad].
        imu: (T, 6) [gyro; accel] of a perfect IMU [rad/s, m/s^2].
        wrench: (T, 6k) of perfect F/T sensors [N, N m].
        torque: (T, n) on the link side [N m].
        dt: Period [s].
    """

    position: FloatArray
    imu: FloatArray
    wrench: FloatArray
    torque: FloatArray
    dt: float


@dataclass(frozen=True)
class Filters:
    """Savitzky-Golay windows [samples] and orders; the paper's by default.

    Attributes:
        encoder: Window of the encoders.
        encoder_order: At least 2.
        other: Window of IMU and F/T.
        other_order: At least 1.
        encoder_at: Point of the encoders' causal window, in samples from the oldest; None: the middle.
        other_at: The same of IMU and F/T.
    """

    encoder: int = 80
    encoder_order: int = 2
    other: int = 80
    other_order: int = 1
    encoder_at: float | None = None
    other_at: float | None = None


@dataclass(frozen=True, eq=False)
class Budget:
    """RMS error of the estimated torque by cause.

    Attributes:
        joints: Names.
        contributions: (n,) [N m] by the cause's name.
        total: (n,) everything on, against the truth of the same instant [N m].
        total_without_lag: (n,) everything on, against the truth of the instant that the estimate is of [N m].
        root_sum: (n,) square root of the sum of the contributions' squares [N m].
        torque_range: (n,) largest minus smallest true torque [N m].
    """

    joints: tuple[str, ...]
    contributions: Mapping[str, FloatArray]
    total: FloatArray
    total_without_lag: FloatArray
    root_sum: FloatArray
    torque_range: FloatArray

    def rows(self) -> list[tuple[str, FloatArray]]:
        """(name, RMS (n,)) of every line of the table, largest contribution first, then root sum and totals."""
        largest = sorted(self.contributions.items(), key=lambda item: -float(np.max(item[1])))
        ends = {
            "root of the sum of squares": self.root_sum,
            "total": self.total,
            "total without lag": self.total_without_lag,
        }
        return [*largest, *ends.items()]


class _Case(NamedTuple):
    suite: SensorSuiteSpec
    model: TorqueModel


def error_budget(
    model: TorqueModel,
    run: Run,
    suite: SensorSuiteSpec,
    filters: Filters | None = None,
    *,
    mass_error: float = 0.02,
    neglected: TorqueModel | None = None,
    stride: int = 5,
    seed: int = 0,
) -> Budget:
    """RMS torque errors by cause.

    Args:
        model: The estimator.
        run: The truth.
        suite: What the sensors do; latency and drop-outs are not looked at.
        filters: Windows and orders; None: the paper's.
        mass_error: Each link's mass and inertia is wrong by a uniform draw of at most this fraction.
        neglected: The estimator with another treatment of the gyro's derivative (angular_acceleration "neglected"), for
            the line "gyro derivative off", which takes no part in total and root sum; None: no such line.
        stride: Every so many samples are estimated (all are filtered).
        seed: Of noise and mass errors.

    Raises:
        ParamsError: Arrays that do not fit the robot, or a run too short for the filters.
    """
    filters = Filters() if filters is None else filters
    _check(model, run, filters)
    rng = np.random.default_rng(seed)
    wrong = _wrong_masses(model, mass_error, rng)
    noise = [rng.standard_normal(x.shape) for x in (run.position, run.imu, run.wrench)]
    margin = max(filters.encoder, filters.other)
    rows = np.arange(margin, run.position.shape[0] - margin, stride)
    perfect = SensorSuiteSpec.perfect()

    def estimate(case: _Case, *, causal: bool = False) -> FloatArray:
        return _torques(case, _smoothed(run, filters, case.suite, noise, causal=causal), rows)

    ideal = _Case(perfect, model)
    reference = estimate(ideal)
    truth = run.torque[rows]
    errors: dict[str, FloatArray] = {
        "filter smoothing": reference - truth,
        "filter lag": estimate(ideal, causal=True) - reference,
    }
    for name, only in imperfections(suite).items():
        errors[name] = estimate(_Case(only, model)) - reference
    if mass_error > 0.0:
        errors["link masses"] = estimate(_Case(perfect, wrong)) - reference
    contributions = {name: _rms(error) for name, error in errors.items()}
    root_sum = np.sqrt(np.sum([value**2 for value in contributions.values()], axis=0))
    if neglected is not None:
        off = estimate(_Case(perfect, neglected))
        contributions["gyro derivative off"] = _rms(off - reference)
    everything = _Case(suite, wrong)
    return Budget(
        joints=model.robot.joints,
        contributions=contributions,
        total=_rms(estimate(everything, causal=True) - truth),
        total_without_lag=_rms(estimate(everything) - truth),
        root_sum=root_sum,
        torque_range=np.ptp(run.torque, axis=0),
    )


def imperfections(suite: SensorSuiteSpec) -> dict[str, SensorSuiteSpec]:
    """Suites with one imperfection each, by its name: noise, bias, scale, quantisation of each kind of sensor."""
    perfect = SensorSuiteSpec.perfect()
    words = {"noise": "noise", "bias": "bias", "scale": "scale", "resolution": "quantisation"}
    found: dict[str, SensorSuiteSpec] = {}
    for kind in ("encoder", "gyro", "accel", "force", "torque"):
        spec, ideal = getattr(suite, kind), getattr(perfect, kind)
        for item in fields(SensorSpec):
            if item.name in words and getattr(spec, item.name) != getattr(ideal, item.name):
                sensor = f"F/T {kind}" if kind in ("force", "torque") else kind
                only = replace(ideal, **{item.name: getattr(spec, item.name)})
                found[f"{sensor} {words[item.name]}"] = replace(perfect, **{kind: only})
    return found


def _smoothed(
    run: Run, filters: Filters, suite: SensorSuiteSpec, noise: list[FloatArray], *, causal: bool
) -> tuple[Smoothed, Smoothed, Smoothed]:
    """Encoders, IMU and F/T as read and filtered."""
    position = _read(run.position, suite.encoder, noise[0])
    gyro, accel = (
        _read(run.imu[:, :3], suite.gyro, noise[1][:, :3]),
        _read(run.imu[:, 3:], suite.accel, noise[1][:, 3:]),
    )
    shape, triples = run.wrench.shape, (run.wrench.shape[0], -1, 2, 3)
    truth, drawn = run.wrench.reshape(triples), noise[2].reshape(triples)
    parts = [_read(truth[:, :, i], spec, drawn[:, :, i]) for i, spec in enumerate((suite.force, suite.torque))]
    wrench = np.stack(parts, axis=2).reshape(shape)
    slow = (filters.other, filters.other_order, filters.other_at)
    return (
        _filtered(position, (filters.encoder, filters.encoder_order, filters.encoder_at), run.dt, causal=causal),
        _filtered(np.hstack([gyro, accel]), slow, run.dt, causal=causal),
        _filtered(wrench, slow, run.dt, causal=causal),
    )


def _filtered(x: FloatArray, how: tuple[int, int, float | None], dt: float, *, causal: bool) -> Smoothed:
    """A log through its filter; `how` is (window, order, at)."""
    window, order, at = how
    if x.shape[1] == 0:
        return Smoothed(x, x, x)
    return smooth_causal(x, window, order, dt, at) if causal else smooth(x, window, order, dt)


def _read(truth: FloatArray, spec: SensorSpec, drawn: FloatArray) -> FloatArray:
    """Readings of a truth (T, ..., c), field by field one value or c values."""
    scale, bias, noise, step = (np.asarray(x, float) for x in (spec.scale, spec.bias, spec.noise, spec.resolution))
    value = scale * truth + bias + noise * drawn
    return np.asarray(np.where(step > 0.0, np.round(value / np.where(step > 0.0, step, 1.0)) * step, value))


def _torques(case: _Case, logs: tuple[Smoothed, Smoothed, Smoothed], rows: Any) -> FloatArray:
    """(len(rows), n) estimated torques."""
    joint, imu, wrench = logs
    motion = (joint.value, joint.first_derivative, joint.second_derivative, imu.value, imu.first_derivative[:, :3])
    return case.model.estimate_log(*(each[rows] for each in (*motion, wrench.value)))[:, : case.model.size]


def _wrong_masses(model: TorqueModel, fraction: float, rng: np.random.Generator) -> TorqueModel:
    """The model with every link's mass and inertia off by up to `fraction`; centres of mass stay."""
    context = model.create_context()
    plant = model.model.plant
    for index in plant.GetBodyIndices(plant.GetModelInstanceByName(model.robot.name)):
        body = plant.get_body(index)
        right = body.default_spatial_inertia()
        if right.get_mass() > 0.0:
            wrong = type(right)(
                right.get_mass() * (1.0 + fraction * rng.uniform(-1.0, 1.0)),
                right.get_com(),
                right.get_unit_inertia(),
            )
            body.SetSpatialInertiaInBodyFrame(context, wrong)
    return model.with_inertias(context)


def _rms(error: FloatArray) -> FloatArray:
    return np.asarray(np.sqrt(np.mean(error**2, axis=0)))


def _check(model: TorqueModel, run: Run, filters: Filters) -> None:
    """The arrays' shapes."""
    samples = run.position.shape[0]
    expected = {
        "position": (samples, model.size),
        "imu": (samples, 6),
        "wrench": (samples, 6 * model.num_sensors),
        "torque": (samples, model.size),
    }
    for name, shape in expected.items():
        if getattr(run, name).shape != shape:
            raise ParamsError(f"error budget: {name}: expected shape {shape}, got {getattr(run, name).shape}")
    longest = max(filters.encoder, filters.other)
    if samples <= 2 * longest:
        raise ParamsError(f"error budget: expected more than {2 * longest} samples, two windows, got {samples}")
