"""What a diagnosis may be told to do otherwise."""

from dataclasses import dataclass, field

from drake_tc.diagnosis.thresholds import JOINT, ResidualThresholds, SearchThresholds


@dataclass(frozen=True)
class DiagnosisOptions:
    """SearchThresholds of the search and of the assessment of what is left; `seed` for resampling.

    `assess_residual`: whether what is left is assessed at all, which costs more than all the rest; False calls nothing
    structured. `width_s`: width of the light kernel [s]; None lets the data choose.
    """

    search: SearchThresholds = JOINT
    residual: ResidualThresholds = field(default_factory=ResidualThresholds)
    seed: int = 0
    assess_residual: bool = True
    width_s: float | None = None
