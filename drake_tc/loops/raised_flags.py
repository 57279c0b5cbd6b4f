"""Which flags a run raised, and when."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from drake_tc.types import FloatArray


def raised_flags(time: FloatArray, signals: Mapping[str, FloatArray], names: Sequence[str]) -> list[dict[str, Any]]:
    """Each flag that was up: its name, and when first; none without the signal "flags".

    Args:
        time: (T,) [s].
        signals: Of a recording; "flags" is (T, flags), above 0 where one is up.
        names: Of the flags.
    """
    if not names or "flags" not in signals:
        return []
    up = signals["flags"] > 0.0
    return [
        {"name": name, "first": float(time[int(np.argmax(up[:, i]))])} for i, name in enumerate(names) if up[:, i].any()
    ]
