"""Intervals that a diagnosis will state after a motion: noise counts where the columns of the parameters have power.

With the rows Z (T, p) of one period, their weights W and the covariance G of the noise of the balance,

    Cov = (Z'WZ)^-1 Z'W G W Z (Z'WZ)^-1 / (number of periods)                                              (sandwich)

G is that of stationary noise. Its density is that of torque noise s_t and of position noise s_q through both filters k,

    S(f) = T |k|^4 (s_t^2 c(f) + s_q^2 |h - J w^2 + i F_v w|^2),   w = 2 pi f,

scaled to the noise that is expected. h: torque per position [N m/rad]; c: colour of the torque noise; T: period [s]. A
number of independent samples is not enough: noise of the acceleration is the larger part of the noise of a run that is
filtered little, and has hardly any power at the frequencies of the columns.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from drake_tc.diagnosis.data.resolution import Resolution
from drake_tc.experiments.design.criteria import Parameters
from drake_tc.experiments.design.joint import BalanceColumns, DesignJoint, MotionColumns
from drake_tc.experiments.design.stacked import StackedColumns
from drake_tc.filtering.common_kernel import CommonKernel
from drake_tc.types import FloatArray

FREQUENCIES = 4000
"""Of the grid on which the density is scaled."""


@dataclass(frozen=True, eq=False)
class NoiseDensity:
    """S(f) of the noise of the balance, two-sided [N m]^2/Hz.

    Attributes:
        joint: With the noise and the filters of the run. resolution: of its sensors.
        held: h [N m/rad].
        inertia: J [kg m^2].
    """

    joint: DesignJoint
    resolution: Resolution
    held: float
    inertia: float

    def at(self, frequency: FloatArray) -> FloatArray:
        """S at frequencies (F,) [Hz]."""
        nyquist = 0.5 / self.joint.context.period
        grid: FloatArray = np.linspace(0.0, nyquist, FREQUENCIES)
        whole = 2.0 * float(np.trapezoid(self._shape(grid), grid))
        return np.asarray(self.joint.noise**2 / whole * self._shape(frequency))

    def _shape(self, frequency: FloatArray) -> FloatArray:
        joint, resolution = self.joint, self.resolution
        turn = 2.0 * np.pi * frequency
        gain = np.ones_like(frequency)
        for width in (joint.kernel_width, joint.final_width):
            gain = gain * CommonKernel(width, joint.context.period).gain(frequency)
        moved = (self.held - self.inertia * turn**2) ** 2 + (joint.numbers.viscous * turn) ** 2
        memory = resolution.torque_correlation_time
        # an exponential autocorrelation exp(-t/m) has the density 2 m/(1 + (w m)^2)
        colour = 2.0 * memory / joint.context.period / (1.0 + (turn * memory) ** 2) if memory > 0.0 else 1.0
        return np.asarray(gain**2 * (resolution.torque_noise**2 * colour + resolution.position_noise**2 * moved))


def standard_deviations(criterion: Parameters, columns: BalanceColumns) -> FloatArray | None:
    """(p,) of the parameters in their typical sizes, after the experiment; None where the noise is not known from logs.

    Args:
        criterion: Of the parameters.
        columns: Of a motion, or of the motions under several loads, with the noise of their runs.
    """
    parts: Sequence[BalanceColumns] = (columns,)
    shares: Sequence[float] = (1.0,)
    if isinstance(columns, StackedColumns):
        parts, shares = columns.parts, columns.shares
    found = [
        _information_and_scores(criterion, part, share * criterion.duration)
        for part, share in zip(parts, shares, strict=True)
    ]
    known = [each for each in found if each is not None]
    if len(known) < len(found):
        return None
    information, scores = (np.sum(each, axis=0) for each in zip(*known, strict=True))
    eigen = np.linalg.eigvalsh(information)
    if not eigen[0] > 1e-12 * eigen[-1]:
        return None
    inverse = np.linalg.inv(information)
    return np.asarray(np.sqrt(np.diag(inverse @ scores @ inverse)))


def _information_and_scores(
    criterion: Parameters, columns: BalanceColumns, duration: float
) -> tuple[FloatArray, FloatArray] | None:
    """Z'WZ and Z'WGWZ (p, p) of the periods in a duration [s]; None where the noise is not known."""
    joint, resolution = columns.joint, columns.joint.resolution
    if resolution is None or not isinstance(columns, MotionColumns):
        return None
    if resolution.raw_velocity_noise > 0.0 or not joint.context.period > 0.0:
        return None
    signals = columns.signals
    servo = joint.context.drive == "position_servo"
    slope = float(np.sqrt(np.mean(signals.load_slope**2)))
    held = slope + (1.0 / joint.numbers.gain if servo else 0.0)
    density = NoiseDensity(joint, resolution, held, signals.rotor_inertia + signals.link_inertia)
    z = criterion.columns(columns)
    weighted = columns.weight[:, None] * z
    step, size = columns.step, z.shape[0]
    passed = np.fft.fft(weighted, axis=0)
    noise = density.at(np.abs(np.fft.fftfreq(size, step))) / step
    scores = np.real(passed.conj().T @ (noise[:, None] * passed)) / size
    periods = duration / (size * step)
    return periods * (z.T @ weighted), periods * scores
