"""`EncoderJumps`: readings of encoders that no joint can have come to since the last one."""

from dataclasses import dataclass

import numpy as np

from drake_tc.types import BoolArray, FloatArray


@dataclass(frozen=True, eq=False)
class EncoderJumps:
    """Two bounds on the way between two readings, one on the speed and one on its change.

    With the way y = u[n] - s over the g ticks since the last new reading s, and the pace w = y/g of those before:

        speed     |y| <= g largest_step
        change    |x| <= g^2 bend + g noise,      x = y - g w

    A reading beyond one of them has jumped. The offset o sums up these x (y, while no pace is known): it says how far a
    reading is from where its joint can be, and goes back to zero where the reading jumps back. Where the joint goes on
    at the pace of the jump, it was the joint that changed its speed, as in a collision, and x is taken out of o again.

    Attributes:
        largest_step: (n,) in one tick [rad].
        bend: Largest acceleration times the tick squared [rad].
        noise: Added to it: what noise and resolution of the readings come to [rad].
    """

    largest_step: FloatArray
    bend: float
    noise: float

    @property
    def wrong(self) -> FloatArray:
        """(n,) offset beyond which a reading is wrong [rad]."""
        return np.minimum(self.largest_step, self.bend + self.noise)

    def find(
        self,
        way: FloatArray,
        ticks: FloatArray,
        new: BoolArray,
        pace: FloatArray,
        offset: FloatArray,
        doubt: FloatArray,
    ) -> BoolArray:
        """(n,) which readings jump now, or have jumped and are still wrong.

        Args:
            way: (n,) y [rad]; not read where not `new`.
            ticks: (n,) g.
            new: (n,) which readings are finite and differ from their last.
            pace: (n,) w [rad per tick], NaN where unknown; updated.
            offset: (n,) o [rad]; updated.
            doubt: (2, n) x and y/g of a jump one reading ago, NaN without; updated.
        """
        with np.errstate(invalid="ignore"):  # ways of readings that are not finite
            change, rate = way - ticks * pace, way / ticks
            possible = np.abs(way) <= ticks * self.largest_step
            goes_on = new & possible & (np.abs(rate - doubt[1]) < np.abs(rate - pace))
            sudden = np.abs(change) > ticks**2 * self.bend + ticks * self.noise
        offset[goes_on] -= doubt[0, goes_on]
        jump = new & ~goes_on & (sudden | ~possible)
        jumped_by = np.where(np.isfinite(pace), change, way)
        offset[jump] += jumped_by[jump]
        doubt[:, new] = np.nan
        doubt[0, jump], doubt[1, jump] = jumped_by[jump], rate[jump]
        settled = new & ~jump
        pace[settled] = rate[settled]
        wrong: BoolArray = jump | (np.abs(offset) > self.wrong)
        return wrong
