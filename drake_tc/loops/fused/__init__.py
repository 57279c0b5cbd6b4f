"""Several stages of a loop in one Drake system: the same numbers in a fraction of the time."""

from drake_tc.loops.fused.fuse import StageValues, fuse, fused_stages
from drake_tc.loops.fused.system import FusedStages

__all__ = ["FusedStages", "StageValues", "fuse", "fused_stages"]
