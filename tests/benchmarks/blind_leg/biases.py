"""Biases that zeroing leaves in the sensors of the benchmark `robot`, and the tolerances that a rig file declares."""

from dataclasses import asdict, dataclass, replace
from typing import Any

import numpy as np

from drake_tc.robot.robot import Robot
from drake_tc.sensing.suite import SensorSuiteSpec
from drake_tc.types import FloatArray

Vector = tuple[float, float, float]
LIMIT = 3.0
"""Draws lie within this many standard deviations: a part beyond its data sheet's limits is not sold."""
ZERO: Vector = (0.0, 0.0, 0.0)


@dataclass(frozen=True)
class Tolerances:
    """Standard deviations of the sensors' biases, each axis by itself.

    Attributes:
        force, torque: Of an F/T sensor [N], [N m].
        accel: [m/s^2]. gyro: [rad/s].
    """

    force: float = 0.1
    torque: float = 0.005
    accel: float = 0.01
    gyro: float = 5e-4

    def scaled(self, factor: float) -> "Tolerances":
        """All of them times a factor."""
        return Tolerances(**{name: factor * value for name, value in asdict(self).items()})

    def draw(self, rng: np.random.Generator) -> "SensorBiases":
        """Biases from normal distributions that are cut off at three standard deviations."""
        sigmas = (self.force, self.torque, self.accel, self.gyro)
        force, torque, accel, gyro = (_vector(sigma * _normal(rng)) for sigma in sigmas)
        return SensorBiases(force, torque, accel, gyro)


@dataclass(frozen=True)
class SensorBiases:
    """What the sensors add to the truth.

    Attributes:
        force, torque: Of the F/T sensor, in its axes [N], [N m].
        accel, gyro: Of the IMU, in its axes [m/s^2], [rad/s].
        scale: Gain of the F/T sensor, 1 is exact.
    """

    force: Vector = ZERO
    torque: Vector = ZERO
    accel: Vector = ZERO
    gyro: Vector = ZERO
    scale: float = 1.0

    def plus(self, **more: FloatArray) -> "SensorBiases":
        """With vectors added to some of the biases, by attribute."""
        changed: dict[str, Any] = {n: _vector(np.asarray(getattr(self, n)) + add) for n, add in more.items()}
        return replace(self, **changed)

    def applied(self, suite: SensorSuiteSpec) -> SensorSuiteSpec:
        """The suite with these biases and this gain."""
        return replace(
            suite,
            force=replace(suite.force, bias=self.force, scale=self.scale),
            torque=replace(suite.torque, bias=self.torque, scale=self.scale),
            accel=replace(suite.accel, bias=self.accel),
            gyro=replace(suite.gyro, bias=self.gyro),
        )

    def estimated(self, what: str) -> dict[str, float]:
        """The whole error of the sensor, by the parameter names of `ft_bias`, `ft_gain` or `imu_bias` in a report."""
        if what == "ft_gain":
            return {"force": self.scale - 1.0, "torque": self.scale - 1.0}
        if what == "ft_bias":
            return by_axis("force", self.force) | by_axis("torque", self.torque)
        return by_axis("accel", self.accel) | by_axis("gyro", self.gyro)


def by_axis(name: str, vector: Vector | list[float]) -> dict[str, float]:
    """`name_x`, `name_y`, `name_z` to the vector's elements."""
    return {f"{name}_{axis}": float(value) for axis, value in zip("xyz", vector, strict=True)}


def declared_sensors(robot: Robot, tolerances: Tolerances) -> dict[str, Any]:
    """The rig file's section `sensors`: standard deviations of the biases; gains and mounting are declared exact."""
    exact = {"gain": 0.0, "alignment": 0.0}
    declared = {f"ft_{m.name}": {"bias": [tolerances.force, tolerances.torque]} | exact for m in robot.force_torque}
    return declared | {f"imu_{m.name}": {"bias": [tolerances.accel, tolerances.gyro]} | exact for m in robot.imu}


def _normal(rng: np.random.Generator) -> FloatArray:
    """(3,) standard normal, each element drawn again until it lies within the limit."""
    drawn = rng.standard_normal(3)
    while (outside := np.abs(drawn) > LIMIT).any():
        drawn[outside] = rng.standard_normal(int(outside.sum()))
    return drawn


def _vector(values: FloatArray) -> Vector:
    x, y, z = (float(value) for value in values)
    return x, y, z
