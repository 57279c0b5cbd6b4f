"""`EncoderJumps`: readings of encoders that no joint can have come to since the last one."""

from dataclasses import dataclass

import numpy as np

from drake_tc.types import BoolArray, FloatArray


@dataclass(frozen=True, eq=False)
class EncoderJumps:
    """Two bounds on the displacement between two readings, one on the speed and one on its change.

    With the displacement y = u[n] - s over the g ticks since the last new reading s, and the speed w [rad per tick] at
    the last reading that did not jump:

        speed     |y| <= g largest_step
        change    |x| <= g^2 largest_change + g noise,      x = y - g w

    A reading that exceeds one of the bounds has jumped, and its x (y, while w is unknown) is added to the offset o: how
    far the reading is from where its joint can be. It is wrong while |o| > min(largest_step, largest_change + noise),
    that is until it jumps back. Where the joint goes on at the speed of the jump, it was the joint that changed its
    speed, as in a collision, and x is taken out of o again.

    Attributes:
        largest_step: (n,) in one tick [rad].
        largest_change: Largest acceleration times the tick squared [rad].
        noise: Added to it: what noise and resolution of the readings come to [rad].
    """

    largest_step: FloatArray
    largest_change: float
    noise: float

    @property
    def wrong(self) -> FloatArray:
        """(n,) offset beyond which a reading is wrong [rad]."""
        return np.minimum(self.largest_step, self.largest_change + self.noise)

    def find(
        self,
        displacement: FloatArray,
        ticks: FloatArray,
        new: BoolArray,
        speed: FloatArray,
        offset: FloatArray,
        doubt: FloatArray,
    ) -> BoolArray:
        """(n,) which readings jump now, or have jumped and are still wrong.

        Args:
            displacement: (n,) y [rad]; not read where not `new`.
            ticks: (n,) g.
            new: (n,) which readings are finite and differ from their last.
            speed: (n,) w [rad per tick], NaN where unknown; updated.
            offset: (n,) o [rad]; updated.
            doubt: (2, n) x and y/g of a jump one reading ago, NaN without; updated.
        """
        with np.errstate(invalid="ignore"):  # ways of readings that are not finite
            change, rate = displacement - ticks * speed, displacement / ticks
            possible = np.abs(displacement) <= ticks * self.largest_step
            goes_on = new & possible & (np.abs(rate - doubt[1]) < np.abs(rate - speed))
            sudden = np.abs(change) > ticks**2 * self.largest_change + ticks * self.noise
        offset[goes_on] -= doubt[0, goes_on]
        jump = new & ~goes_on & (sudden | ~possible)
        jumped_by = np.where(np.isfinite(speed), change, displacement)
        offset[jump] += jumped_by[jump]
        doubt[:, new] = np.nan
        doubt[0, jump], doubt[1, jump] = jumped_by[jump], rate[jump]
        settled = new & ~jump
        speed[settled] = rate[settled]
        wrong: BoolArray = jump | (np.abs(offset) > self.wrong)
        return wrong
