"""What is known of the link-load columns of a joint: see `problem.shared.open_directions`."""

from dataclasses import dataclass

from drake_tc.types import FloatArray


def column_name(number: int) -> str:
    """Last part of the name of a run's column."""
    return f"link_load_{number}"


@dataclass(frozen=True, eq=False)
class LinkPrior:
    """Gaussian prior of the coefficients theta of `effects.link_load`.

    Attributes:
        mean: (r,).
        precision: Of each of them, in units in which a row's squared residual counts 1 [N^2 m^2].
    """

    mean: FloatArray
    precision: float
