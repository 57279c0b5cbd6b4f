"""`TorqueNoise`: torques that err, e ~ N(0, Sigma), drawn anew every `period`."""

from typing import Any

import numpy as np
from pydrake.systems.framework import DiscreteValues, LeafSystem

from drake_tc.errors import ParamsError
from drake_tc.loops.scenarios.base import SEEDS
from drake_tc.tsid.robust.options import TorqueError
from drake_tc.types import FloatArray


class TorqueNoise(LeafSystem):
    """A torque error e = scale L zeta, zeta ~ N(0, I), L L^T = Sigma; held for `period`.

    Output:
        torque_error (n): e[k] [N m]; follows the state alone.
    State: e (n), k.  e[k], zeta[k] a function of (seed, k): the stream is counter-based, so it has no memory.
    """

    def __init__(self, error: TorqueError, period: float, seed: int, scale: float = 1.0) -> None:
        """Declare the port.

        Args:
            error: Sigma.
            period: How long a draw lasts [s].
            seed: Of the draws, from 0 to 2^64 - 1.
            scale: On e.

        Raises:
            ParamsError: a period that is not positive, or a seed that is not possible.
        """
        super().__init__()
        if not (np.isfinite(period) and period > 0.0):
            raise ParamsError(f"torque noise: expected a positive period [s], got {period!r}")
        if not 0 <= seed < SEEDS:
            raise ParamsError(f"torque noise: expected a seed from 0 to 2^64 - 1, got {seed}")
        self._root, self._seed = scale * error.root, seed
        first: Any = self._draw(0)
        now = self.DeclareDiscreteState(first)
        zero: Any = np.zeros(1)
        count = self.DeclareDiscreteState(zero)
        self._now, self._count = int(now), int(count)
        self.DeclareStateOutputPort("torque_error", now)
        self.DeclarePeriodicDiscreteUpdateEvent(period, period, self._update)

    def _draw(self, tick: int) -> FloatArray:
        """e[k]."""
        key = np.array([self._seed, tick], dtype=np.uint64)
        zeta = np.random.Generator(np.random.Philox(key=key)).standard_normal(self._root.shape[1])
        return np.asarray(self._root.dot(zeta))

    def _update(self, context: Any, values: DiscreteValues) -> None:
        """The next e."""
        new: Any = values
        tick = int(context.get_discrete_state(self._count).value()[0]) + 1
        new.set_value(self._now, self._draw(tick))
        new.set_value(self._count, np.array([float(tick)]))
