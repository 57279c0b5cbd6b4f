"""How much of a page's bytes each plot may take, so that a page stays below 4 MB for many joints and runs."""

from dataclasses import dataclass

from drake_tc.report.bins import MOST_POINTS
from drake_tc.report.residual_plots import CloudLook
from drake_tc.report.svg import PIXELS_PER_INCH

SAMPLE_BYTES = 16
"""Of one sample of a trace: time, measured value and two errors, as text, and what surrounds them."""
TRACE_BYTES = 1_900_000
"""Of all traces of a page."""
MOST_SAMPLES, LEAST_SAMPLES = 6000, 60
"""Of one trace: two for each pixel of a wide screen and some to zoom into, and what still shows the motion."""
FULL_JOINTS = 1.5
"""Joints up to which clouds are drawn with all that a plot shows; more joints share as much."""

TRAIN_JOINTS = 4
"""Joints up to which the residual of the training runs is drawn against every signal too."""


@dataclass(frozen=True)
class PageBudget:
    """Sizes of a page's plots.

    Attributes:
        trace_samples: Samples of one trace of one run.
        held, train: Look of the clouds of the held-out and of the training runs; None where these are left out.
    """

    trace_samples: int
    held: CloudLook
    train: CloudLook | None

    @classmethod
    def of(cls, joints: int, traces: int) -> "PageBudget":
        """The sizes for a page with so many joints and traces."""
        each = TRACE_BYTES // (SAMPLE_BYTES * max(traces, 1))
        samples = min(MOST_SAMPLES, max(LEAST_SAMPLES, each))
        share = min(1.0, FULL_JOINTS / max(joints, 1))
        sharpness = round(PIXELS_PER_INCH * share**0.5)
        held, train = (CloudLook(round(n * share), sharpness) for n in (MOST_POINTS, MOST_POINTS // 2))
        return cls(samples, held, train if joints <= TRAIN_JOINTS else None)
