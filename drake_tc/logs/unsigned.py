"""An effort that is recorded without its sign: |y| in place of y.

Some drives report the amplitude of the current. The balance  y = (tau + J qddot + f_v qdot + f_c sign(qdot)) / K + c
then holds for s y, s = 1 or -1, and nowhere for y where the joint needs efforts of both signs. The signs s are those of
the balance itself: they are first those of the load and then of the fit to s y, until they no longer change.
"""

from collections.abc import Sequence

import numpy as np

from drake_tc.errors import LogError
from drake_tc.logs.record import Run
from drake_tc.logs.rig import Rig
from drake_tc.logs.signs import balance_of
from drake_tc.types import FloatArray

BELOW_ZERO = 0.01
"""Least effort over the largest one, below 0, of an effort that has a sign."""
BOTH_SIGNS = 0.1
"""Share of the samples in which the balance must ask for either sign."""
LEAST_LEFT = 0.2
"""Share of the effort's standard deviation that the balance must leave of it as it is recorded."""
MUCH_BETTER = 0.5
"""Share of that error which may be left at most of the effort with the signs of the balance."""
ROUNDS = 10


def refuse_unsigned(runs: Sequence[Run], rig: Rig) -> None:
    """Refuse runs whose current, voltage or commanded torque is an absolute value.

    Raises:
        LogError: names file and column.
    """
    for joint in (joint for joint in rig.joints if rig.drive[joint] != "position_servo"):
        for run in runs:
            balance = balance_of(run, rig, joint)
            if balance is not None and is_unsigned(*balance):
                name = rig.command_column(joint)
                raise LogError(
                    f"{run.source or run.name}: column {rig.columns.get(name, name)!r} of {joint} seems to be an "
                    "absolute value: it is never negative, and load and motion need efforts of both signs; record it "
                    "with its sign"
                )


def is_unsigned(effort: FloatArray, load: FloatArray, others: FloatArray) -> bool:
    """Whether an effort (N,) of one sign fits the balance only with the signs that the balance asks for.

    Args:
        effort: (N,) as recorded.
        load: (N,) load torque [N m].
        others: (N, k) what else is in the balance.
    """
    if effort.min() < -BELOW_ZERO * effort.max():
        return False
    columns = np.column_stack([load, others])
    as_it_is = effort - columns @ np.linalg.lstsq(columns, effort, rcond=None)[0]
    sign = np.where(load < 0.0, -1.0, 1.0)
    for _ in range(ROUNDS):
        fitted = columns @ np.linalg.lstsq(columns, sign * effort, rcond=None)[0]
        before, sign = sign, np.where(fitted < 0.0, -1.0, 1.0)
        if np.array_equal(before, sign):
            break
    left = float(np.std(as_it_is))
    share = float(np.mean(sign < 0.0))
    return bool(
        min(share, 1.0 - share) >= BOTH_SIGNS
        and left > LEAST_LEFT * np.std(effort)
        and np.std(sign * effort - fitted) <= MUCH_BETTER * left
    )
