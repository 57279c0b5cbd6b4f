"""An order of runs that is not that of their files."""

from collections.abc import Sequence

import numpy as np

from drake_tc.logs.record import Run
from drake_tc.logs.rig import Rig


def in_order(runs: Sequence[Run], rig: Rig) -> list[Run]:
    """The runs in an order that depends on what they hold alone, so that nothing depends on the order of the files.

    Sorted by length, sampling period and the spread of each joint's position and command, to six digits: names, units,
    zeros and signs do not change it.
    """

    def key(run: Run) -> tuple[float, ...]:
        spreads = [float(np.std(run.columns[c])) for j in rig.joints for c in (f"{j}/position", rig.command_column(j))]
        return (len(run), *(float(f"{x:.6g}") for x in (run.period, *spreads)))

    return sorted(runs, key=key)
