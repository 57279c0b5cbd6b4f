"""How much of a page's bytes each plot may take, so that a page stays below 4 MB for many joints and runs."""

from dataclasses import dataclass

SAMPLE_BYTES = 16
"""Of one sample of a trace: time, measured value and two errors, as text, and what surrounds them."""
TRACE_BYTES = 1_000_000
"""Of all traces of a page."""
MOST_SAMPLES, LEAST_SAMPLES = 6000, 60
"""Of one trace: two for each pixel of a wide screen and some to zoom into, and what still shows the motion."""
FULL_JOINTS = 2
"""Joints up to which clouds are drawn with all that a plot shows."""


@dataclass(frozen=True)
class PageBudget:
    """Sizes of a page's plots.

    Attributes:
        trace_samples: Samples of one trace of one run.
        cloud_points, train_points: Points of one cloud on the held-out and on the training runs.
        pixels_per_inch: Of the clouds' bitmaps.
    """

    trace_samples: int = MOST_SAMPLES
    cloud_points: int = 3000
    train_points: int = 1500
    pixels_per_inch: int = 180

    @classmethod
    def of(cls, joints: int, traces: int) -> "PageBudget":
        """The sizes for a page with so many joints and traces."""
        each = TRACE_BYTES // (SAMPLE_BYTES * max(traces, 1))
        samples = min(MOST_SAMPLES, max(LEAST_SAMPLES, each))
        share = min(1.0, FULL_JOINTS / max(joints, 1))
        return cls(samples, round(3000 * share), round(1500 * share), round(180 * max(share, 0.25) ** 0.5))
