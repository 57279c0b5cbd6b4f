"""How exactly a robust program is solved, and for how long."""

from dataclasses import dataclass, field

from drake_tc.errors import ParamsError
from drake_tc.tsid.robust.budget import Budget


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
