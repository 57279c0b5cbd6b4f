"""Samples at which the teeth of a gear with backlash are apart.

The teeth part when the torque that the gear transmits changes its sign. While the motor crosses the gap, and while it
oscillates on the stiffness of its servo afterwards, its position does not follow from that of the link.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.ndimage import maximum_filter1d

from drake_tc.effects.base import Shape, Signals, TorqueEffect
from drake_tc.types import BoolArray, FloatArray


@dataclass(frozen=True)
class OpenGap:
    """How long the teeth are apart, and the loads that the gear may transmit besides the known load.

    Attributes:
        within: Time before and after a sign change of the transmitted torque [s].
        loads: Load effects that may act on the link, with their shapes and coefficients [N m].
    """

    within: float
    loads: tuple[tuple[TorqueEffect, Shape, FloatArray], ...] = ()

    def is_open(self, signals: Signals, segments: Sequence[slice]) -> BoolArray:
        """(T,) whether the transmitted torque changes its sign less than `within` before or after the sample.

        Sign changes of the torque with `loads` and without them both count, because an effect such as a cable may pull
        at the link or at the motor.

        Args:
            signals: Of all samples.
            segments: Contiguous stretches of them.
        """
        known = signals.load_torque
        more = sum((e.columns(signals, shape) @ theta for e, shape, theta in self.loads), np.zeros_like(known))
        near = np.zeros(known.size, dtype=bool)
        size = 2 * round(self.within / signals.period) + 1
        for s in segments:
            for torque in (known[s], known[s] + more[s]):
                near[s][np.flatnonzero(np.diff(np.sign(torque)))] = True
            near[s] = maximum_filter1d(near[s].astype(np.uint8), size, mode="constant").astype(bool)
        return near
