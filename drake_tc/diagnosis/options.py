"""What a diagnosis may be told to do otherwise."""

from dataclasses import dataclass, field

from drake_tc.diagnosis.residual.structure import ResidualOptions
from drake_tc.diagnosis.selection.thresholds import JOINT, Thresholds


@dataclass(frozen=True)
class DiagnosisOptions:
    """Thresholds of the search and of the assessment of what is left; `seed` for resampling.

    `assess_residual`: whether what is left is assessed at all, which costs more than all the rest; False calls nothing
    structured.
    """

    search: Thresholds = JOINT
    residual: ResidualOptions = field(default_factory=ResidualOptions)
    seed: int = 0
    assess_residual: bool = True
