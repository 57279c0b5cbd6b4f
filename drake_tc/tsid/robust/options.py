"""How exactly a robust program is solved, and for how long.

How long a robust solve may take, over all programs that it consists of.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass, field

from drake_tc.errors import ParamsError


@dataclass(frozen=True)
class Budget:
    """When to stop early.

    Attributes:
        iterations: Steps of Newton's method at most, of all programs of a solve together.
        seconds: Wall time at most, by `clock`; infinite for a simulation that shall repeat itself.
        clock: Seconds, e.g. time.perf_counter; needed where `seconds` is finite.

    Raises:
        ParamsError: no iterations, a time that is not positive, or a finite time without a clock.
    """

    iterations: int = 1000
    seconds: float = math.inf
    clock: Callable[[], float] | None = None

    def __post_init__(self) -> None:
        if self.iterations < 1:
            raise ParamsError(f"iterations: expected at least 1, got {self.iterations}")
        if not self.seconds > 0.0:
            raise ParamsError(f"seconds: expected more than 0, got {self.seconds:g}")
        if math.isfinite(self.seconds) and self.clock is None:
            raise ParamsError("budget: expected a clock, as seconds is finite; time.perf_counter is one")

    def started(self) -> "Spending":
        """The budget with its time running from now on."""
        return Spending(self)


class Spending:
    """What is left of a budget."""

    __slots__ = ("_clock", "_left", "_until")

    def __init__(self, budget: Budget) -> None:
        """Start the time."""
        self._left = budget.iterations
        self._clock = budget.clock if math.isfinite(budget.seconds) else None
        self._until = self._clock() + budget.seconds if self._clock is not None else math.inf

    def most(self) -> int:
        """How many steps may be taken until it is asked again whether this is `late`."""
        return max(self._left, 1) if self._clock is None else 1

    def steps(self, count: int) -> None:
        """Count steps."""
        self._left -= count

    def late(self) -> bool:
        """Whether nothing is left."""
        return self._left <= 0 or (self._clock is not None and self._clock() >= self._until)


@dataclass(frozen=True)
class Options:
    """Of Newton's method.

    Attributes:
        accuracy: A program ends when the model promises less than this times the weight of R. Tasks that count less
            than that beside R are met only as well as this leaves them. A smaller accuracy needs more iterations, most
            of all in a cold start far from all limits.
        budget: Of iterations and, where it has a clock, of wall time; the best feasible torque comes back.

    Raises:
        ParamsError: an accuracy that is not above 0.
    """

    accuracy: float = 1e-6
    budget: Budget = field(default_factory=Budget)

    def __post_init__(self) -> None:
        if not self.accuracy > 0.0:
            raise ParamsError(f"accuracy: expected > 0, got {self.accuracy:g}")
