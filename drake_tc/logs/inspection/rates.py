"""The unit of a velocity, as the rate of the position beside it tells."""

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from drake_tc.logs.inspection.column import Column
from drake_tc.logs.inspection.names import Meaning
from drake_tc.logs.units import allowed_units, joint_type_of_unit
from drake_tc.types import FloatArray

AGREES = 0.15
"""Difference of a velocity from the rate of the position, as a share of it, within which their units fit."""
CORRELATED = 0.8
"""Correlation of a velocity with the rate of the position from which on their ratio tells the unit."""


def with_units_of_rates(
    columns: Sequence[Column],
    meanings: Mapping[str, Meaning],
    numbers: Mapping[str, FloatArray | None],
    time: FloatArray,
) -> tuple[Column, ...]:
    """The columns, where a velocity without a stated unit has the one in which it is the rate of the position.

    With the position q in its unit of factor f_q to SI, the velocity's factor to SI is f_q |dq/dt| / |v|, in RMS.

    Args:
        columns: Of the log.
        meanings: What the names of columns tell.
        numbers: (T,) by column.
        time: (T,) [s].
    """
    positions = {m.joint: name for name, m in meanings.items() if m.quantity == "position"}
    units = {column.name: column.unit for column in columns}
    out = []
    for column in columns:
        told = meanings.get(column.name)
        position = positions.get(told.joint, "") if told is not None and told.quantity == "velocity" else ""
        q, v = numbers.get(position), numbers.get(column.name)
        if told is not None and not told.unit and "rpm" not in told.by and q is not None and v is not None:
            unit = _unit_of_rate(q, v, time, units[position])
            if unit and unit != column.unit:
                why = f"called {told.by}; in {unit} it is the rate of {position!r}"
                column = replace(column, unit=unit, why=why)
        out.append(column)
    return tuple(out)


def _unit_of_rate(position: FloatArray, velocity: FloatArray, time: FloatArray, unit: str) -> str:
    """The unit in which a velocity (T,) is the rate of a position (T,) in `unit`; empty where none fits."""
    try:
        factor = allowed_units("position").get(unit) or float(unit)
    except ValueError:
        return ""
    kind = joint_type_of_unit(unit) or "revolute"
    good = np.isfinite(position) & np.isfinite(velocity) & np.isfinite(time)
    q, v, t = position[good], velocity[good], time[good]
    if q.size < 20 or np.any(np.diff(t) <= 0.0) or v.std() == 0.0:
        return ""
    # over stretches of some samples, the mean of the velocity is the way over the time, whatever the encoder's step
    step = max(1, min(q.size // 20, round(0.05 / float(np.median(np.diff(t))))))
    way = factor * (q[step:] - q[:-step]) / (t[step:] - t[:-step])
    summed = np.concatenate([[0.0], np.cumsum(0.5 * (v[1:] + v[:-1]) * np.diff(t))])
    mean = (summed[step:] - summed[:-step]) / (t[step:] - t[:-step])
    if mean.std() == 0.0 or way.std() == 0.0 or abs(float(np.corrcoef(way, mean)[0, 1])) < CORRELATED:
        return ""
    ratio = float(way.std() / mean.std())
    fits = [
        (abs(np.log(ratio / scale)), name)
        for name, scale in allowed_units("velocity").items()
        if joint_type_of_unit(name) == kind
    ]
    best = min(fits, default=(np.inf, ""))
    return best[1] if best[0] < AGREES else ""
