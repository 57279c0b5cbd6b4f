"""Filters: Savitzky–Golay (causal and for logs) and one common kernel for all channels of a log."""

from drake_tc.filtering.common_kernel import CommonKernel
from drake_tc.filtering.savitzky_golay import (
    SavitzkyGolayFilter,
    delay,
    savgol_weights,
    smooth,
    smooth_causal,
)

__all__ = [
    "CommonKernel",
    "SavitzkyGolayFilter",
    "delay",
    "savgol_weights",
    "smooth",
    "smooth_causal",
]
