"""A note on the gear between two encoders: the balance of a current or voltage drive does not see play in it."""

from dataclasses import dataclass

import numpy as np

from drake_tc.diagnosis.notes import GearBetweenEncoders
from drake_tc.diagnosis.problem.columns import Columns
from drake_tc.types import FloatArray, IntArray

CLEARLY_LOADED = 0.2
"""Load over its RMS, from which on the gear lies on one side of its play."""
LEAST_ROWS = 200
RESAMPLES = 200


@dataclass(frozen=True)
class Gear:
    """What two encoders tell of the gear: q_motor - q = zero + (play/2) sign(tau) + compliance tau.

    Under a load of one sign, play is part of the zero, and its interval is (0, 0).

    Attributes:
        play: Whole gap [rad], with its 95 % interval. compliance: [rad/(N m)], with its 95 % interval.
    """

    play: float
    play_ci95: tuple[float, float]
    compliance: float
    compliance_ci95: tuple[float, float]

    def note(self, step: float) -> GearBetweenEncoders | None:
        """What the encoders show of it; None where they resolve neither. `step`: of the encoder [rad]."""
        play = (self.play, *self.play_ci95) if self.play_ci95[0] > step else None
        compliance = (self.compliance, *self.compliance_ci95) if self.compliance_ci95[0] > 0.0 else None
        return None if play is None and compliance is None else GearBetweenEncoders(play, compliance)


def gear_between_encoders(columns: Columns, seed: int = 0) -> Gear | None:
    """Play and compliance of the gear from rows under a clear load; None without a motor's encoder or a load.

    Intervals are from resampling blocks of half a second.

    Args:
        columns: Training rows.
        seed: Of the resampling.
    """
    samples = columns.samples
    signals = samples.signals
    if not signals.has("motor_position") or samples.load_unknown:
        return None
    tau, twist = signals.load_torque[samples.rows], (signals.motor_position - signals.position)[samples.rows]
    clear = np.isfinite(twist) & (np.abs(tau) > CLEARLY_LOADED * np.sqrt(np.mean(tau**2)))
    if clear.sum() < LEAST_ROWS:
        return None
    both_sides = bool(np.ptp(np.sign(tau[clear])) > 0.0)
    design = np.stack([np.ones(tau.size), 0.5 * both_sides * np.sign(tau), tau], axis=-1)[clear]
    _, block = np.unique(samples.block[clear], return_inverse=True)
    drawn = _resampled(design, twist[clear], block, seed)
    play, compliance = np.linalg.lstsq(design, twist[clear], rcond=None)[0][1:]
    low, high = np.quantile(drawn, [0.025, 0.975], axis=0)
    return Gear(float(play), (float(low[1]), float(high[1])), float(compliance), (float(low[2]), float(high[2])))


def _resampled(design: FloatArray, target: FloatArray, block: IntArray, seed: int) -> FloatArray:
    """(R, 3) least-squares solutions of resampled blocks."""
    count = int(block.max()) + 1
    normal = np.zeros((count, 3, 3))
    moment = np.zeros((count, 3))
    np.add.at(normal, block, design[:, :, None] * design[:, None, :])
    np.add.at(moment, block, design * target[:, None])
    draws = np.random.default_rng(seed).integers(0, count, (RESAMPLES, count))
    return np.stack([np.linalg.lstsq(normal[d].sum(0), moment[d].sum(0), rcond=None)[0] for d in draws])
