"""`ModelHealth`: the torque errors of a loop's models while nothing has changed, which a `ModelMonitor` needs."""

from dataclasses import dataclass, replace

import numpy as np

from drake_tc.actuation.joint_effects import Models, model_list
from drake_tc.control.torque_uncertainty_file import TorqueUncertainty
from drake_tc.errors import ParamsError
from drake_tc.types import BoolArray, FloatArray
from drake_tc.watch.monitor import CAUSES, ModelMonitor, ModelMonitorSpec

EVERY_TICK = 1e-9
"""Correlation time with which every tick is a row of its own [s]."""
FOREVER = 1e12
"""Rows of a memory that forgets nothing."""
ROUNDS = 2
"""Of estimates of the reference, and of deviation and correlation time beside it."""
LEAST_MOTION_S = 5.0
"""Shortest time in motion from which the error of a joint is estimated [s]."""
LONGEST_S = 2.0
"""Lag up to which the autocorrelation is summed [s]."""


@dataclass(frozen=True, eq=False)
class ModelHealth:
    """The torque error of n sound joints.

    Attributes:
        joints: Names.
        deviation: (n,) standard deviation of the error beside `reference` [N m].
        correlation_time: (n,) of the same, integrated over positive and negative lags [s].
        reference: (n, C) changes by which the model is off, of each of `CAUSES`.

    Example:
        >>> ModelHealth(("knee",), np.array([0.5]), np.array([0.02]), np.zeros((1, 7))).deviation
        array([0.5])
    """

    joints: tuple[str, ...]
    deviation: FloatArray
    correlation_time: FloatArray
    reference: FloatArray

    @classmethod
    def of(cls, found: TorqueUncertainty) -> "ModelHealth":
        """As a torque uncertainty file has it.

        Raises:
            ParamsError: a file without correlation times.
        """
        if not np.isfinite(found.correlation_time).all():
            raise ParamsError("torque uncertainty: expected the correlation time of every joint, got none")
        off = [[found.reference.get(joint, {}).get(cause, 0.0) for cause in CAUSES] for joint in found.joints]
        return cls(found.joints, found.sigma, found.correlation_time, np.array(off))

    def monitor(self, models: Models, spec: ModelMonitorSpec | None = None, dt: float = 1e-3) -> ModelMonitor:
        """A monitor for these joints, in their order or in another one.

        Raises:
            ParamsError: a joint that is not here.
        """
        listed = model_list(models)
        missing = [model.joint for model in listed if model.joint not in self.joints]
        if missing:
            raise ParamsError(f"health: no joint {missing[0]!r}; joints here: {', '.join(self.joints)}")
        at = [self.joints.index(model.joint) for model in listed]
        deviation, time = self.deviation[at], self.correlation_time[at]
        return ModelMonitor(listed, deviation, time, spec, dt, reference=self.reference[at])

    def uncertainty(self) -> TorqueUncertainty:
        """As a torque uncertainty file has it."""
        n, nothing = len(self.joints), np.zeros(len(self.joints))
        off = {
            joint: dict(zip(CAUSES, row, strict=True))
            for joint, row in zip(self.joints, self.reference.tolist(), strict=True)
        }
        return TorqueUncertainty(
            joints=self.joints,
            covariance=np.diag(self.deviation**2),
            mean=nothing,
            ci95=np.full((n, 2), np.nan),
            correlation_time=self.correlation_time,
            effective_samples=nothing,
            samples=nothing,
            reference=off,
        )


def health_of(models: Models, seen: FloatArray, dt: float, spec: ModelMonitorSpec | None = None) -> ModelHealth:
    """The health of joints from a recording in which nothing changed; a minute in which all joints move is enough.

    Args:
        models: Of n joints.
        seen: (T, 5, n) position, velocity, acceleration, load torque and effort, as of `ModelMonitor`.
        dt: Period [s].
        spec: None: the defaults.

    Raises:
        ParamsError: a joint that hardly moves.

    Example:
        >>> models = [ActuatorModel("knee", Drive("current", 0.1), (EffectValue("viscous", {"viscous": 2.0}),))]
        >>> time = np.arange(0.0, 10.0, 5e-3)
        >>> torque = 2.0 * np.cos(time) + 0.1 * np.random.default_rng(0).standard_normal(time.size)
        >>> nothing = np.zeros(time.size)
        >>> seen = np.stack([np.sin(time), np.cos(time), -np.sin(time), nothing, 0.1 * torque], axis=1)[:, :, None]
        >>> health_of(models, seen, 5e-3).deviation.round(1)
        array([0.1])
    """
    listed = model_list(models)
    spec = replace(spec or ModelMonitorSpec(), memory=FOREVER)
    moving = np.abs(seen[:, 1]) > spec.rest + spec.reversal * np.abs(seen[:, 2])
    for model, time in zip(listed, (dt * moving.sum(axis=0)).tolist(), strict=True):
        if time < LEAST_MOTION_S:
            raise ParamsError(
                f"{model.joint}: expected at least {LEAST_MOTION_S:g} s of motion in this run, got {time:.1f} s"
            )
    n = len(listed)
    deviation, time, reference = np.ones(n), np.full(n, EVERY_TICK), np.zeros((n, len(CAUSES)))
    for _ in range(ROUNDS):  # the reference that is weighed as the monitor will weigh it
        weighing = ModelMonitor(listed, deviation, time, spec, dt)
        reference = _shown(weighing, seen)[-1, :, -len(CAUSES) :]
        plain = ModelMonitor(listed, 1.0, EVERY_TICK, spec, dt, reference=reference)
        residual = _shown(plain, seen)[:, :, 0]
        deviation, time = np.array([healthy_error(residual[:, j], moving[:, j], dt) for j in range(n)]).T
    return ModelHealth(tuple(model.joint for model in listed), deviation, time, reference)


def _shown(monitor: ModelMonitor, seen: FloatArray) -> FloatArray:
    """(T, n, 4 + C) outputs of a monitor over a recording."""
    n = seen.shape[2]
    (memory, shown), warm = monitor.start(), monitor.room
    external, out = np.zeros((1, n)), np.empty((len(seen), n, shown.size // n))
    for k, each in enumerate(seen):
        monitor.tick(np.concatenate([each, external]), monitor.needed(each, warm), memory, shown)
        out[k] = shown.reshape(n, -1)
    return out


def healthy_error(residual: FloatArray, moving: BoolArray, dt: float) -> tuple[float, float]:
    """Deviation [N m] and correlation time [s] of a joint's torque error.

    The correlation time is the integral of the autocorrelation between its first zeros on both sides.

    Args:
        residual: (T,) [N m].
        moving: (T,) whether the joint moves; other rows are left out.
        dt: Between rows [s].
    """
    used = np.where(moving, residual, 0.0)
    variance = max(float(used @ used) / max(float(np.count_nonzero(moving)), 1.0), 1e-300)
    total = 0.0
    for lag in range(1, min(residual.size, round(LONGEST_S / dt))):
        both = np.count_nonzero(moving[lag:] & moving[:-lag])
        share = float(used[lag:] @ used[:-lag]) / (variance * max(float(both), 1.0))
        if share <= 0.0:
            break
        total += share
    return float(np.sqrt(variance)), dt * (1.0 + 2.0 * total)
