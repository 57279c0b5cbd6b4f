"""What a joint's rows contain, in the quantities by which an engineer says why an effect cannot show."""

from dataclasses import dataclass

import numpy as np

from drake_tc.config.joint_units import TURNING, JointUnits
from drake_tc.diagnosis.problem.columns import Columns
from drake_tc.effects.base import Context

SLOW = 0.1
"""Share of the largest speed, below which a row counts as slow."""


@dataclass(frozen=True)
class MotionFacts:
    """Of the rows in which the joint slides.

    Attributes:
        speed: Largest speed [rad/s]. slow: share of the rows that are slower than a tenth of it.
        span: Travelled range [rad]. reversals: times the motion turns over.
        load: (lowest, highest) load torque [N m]. load_crosses: whether both signs occur in motion.
        load_change: Standard deviation of |tau| over its mean.
        effort: Largest effort. effort_crosses: whether both signs occur.
        inertial: RMS of the torque that the accelerations need [N m], of a link of the whole inertia.
        rise: Change of the recorded temperature [K]; NaN where it was not recorded.
        duration: Of the longest run [s].
        units: Of the joint; torques are told as effort where nothing fixes their scale.
    """

    speed: float
    slow: float
    span: float
    reversals: int
    load: tuple[float, float]
    load_crosses: bool
    load_change: float
    effort: float
    effort_crosses: bool
    inertial: float
    rise: float
    duration: float
    units: JointUnits = TURNING

    @classmethod
    def of(cls, columns: Columns, context: Context, inertia: float) -> "MotionFacts":
        """Of training rows; `inertia` of rotor and link [kg m^2]."""
        s, rows = columns.samples.signals, columns.samples.rows
        speed, tau, effort = np.abs(s.velocity[rows]), s.expected_torque[rows], s.effort[rows]
        tau = s.load_torque[rows] if np.ptp(s.load_torque[rows]) > 0.0 else tau
        low, high = (float(np.percentile(tau, p)) for p in (1, 99))
        mean = float(np.mean(np.abs(tau)))
        margin = 0.02 * max(abs(low), abs(high), 1e-12)
        ends = np.percentile(effort, [1, 99])
        warm = context.temperature_span
        return cls(
            speed=context.max_speed,
            slow=float(np.mean(speed < SLOW * context.max_speed)),
            span=float(np.ptp(context.position_span)),
            reversals=int(np.count_nonzero(np.diff(np.sign(s.direction)))),
            load=(low, high),
            load_crosses=bool(low < -margin and high > margin),
            load_change=float(np.std(np.abs(tau))) / max(mean, 1e-12),
            effort=context.effort,
            effort_crosses=bool(ends[0] < 0.0 < ends[1]),
            inertial=inertia * float(np.sqrt(np.mean(s.acceleration[rows] ** 2))),
            rise=float(warm[1] - warm[0]),
            duration=context.duration,
            units=columns.samples.units,
        )
