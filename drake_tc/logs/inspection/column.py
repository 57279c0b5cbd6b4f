"""What one column of a log seems to be, in which unit, and why."""

from dataclasses import dataclass

import numpy as np
import pandas as pd

from drake_tc.logs.channels import grid_step
from drake_tc.logs.columns import seconds_of_dates
from drake_tc.logs.inspection.names import COUNTS, DUTY_CYCLE, Meaning
from drake_tc.logs.units import SENSOR_SUFFIXES
from drake_tc.types import FloatArray

MOST_TURNS = 4.0 * np.pi
"""An angle that spans more is not in rad."""
MOST_DEGREES = 3600.0
"""An angle that lies further out is not in degrees."""
MOST_AMPERES = 100.0
MOST_VOLTS = 200.0
FASTEST = 50.0
"""A velocity above is not in rad/s."""
NAMELESS = "joint"
"""Name of a joint whose columns name none."""
SI = {
    "velocity": "rad/s",
    "velocity_command": "rad/s",
    "current": "A",
    "current_command": "A",
    "voltage": "V",
    "supply_voltage": "V",
    "torque": "N*m",
    "torque_command": "N*m",
    "temperature": "degC",
    **{name: next(u for u, factor in units.items() if factor == 1.0) for name, units in SENSOR_SUFFIXES.items()},
}
"""The canonical units of what is no angle and no time."""


@dataclass(frozen=True)
class Column:
    """One column of a log.

    Attributes:
        name: In the file.
        canonical: What it is taken for; empty where nothing tells.
        unit: That it seems to be in.
        why: What told name and unit.
        low, high: Smallest and largest value, as in the file.
        step: Of the values, where they lie on a grid; else 0.
        missing: Share of the rows without a number.
    """

    name: str
    canonical: str
    unit: str
    why: str
    low: float
    high: float
    step: float
    missing: float


def numbers(series: pd.Series) -> FloatArray | None:
    """(T,) as numbers, dates in seconds from the first; None where it holds none."""
    if pd.api.types.is_complex_dtype(series):
        return None
    values = seconds_of_dates(series) if pd.api.types.is_datetime64_any_dtype(series) else _parsed(series)
    return values if np.isfinite(values).any() else None


def _parsed(series: pd.Series) -> FloatArray:
    return np.asarray(pd.to_numeric(series, errors="coerce").to_numpy(dtype=np.float64, na_value=np.nan))


def describe(
    name: str, values: FloatArray | None, told: Meaning | None, time_unit: str, beside: FloatArray | None = None
) -> Column:
    """What a column seems to be.

    Args:
        name: In the file.
        values: (T,); None where it holds no numbers.
        told: What its name tells.
        time_unit: Unit of the time.
        beside: (S,) values of a column that has the same unit: a position beside its command, or the other way round.
            The unit is then that of both together.
    """
    if values is None:
        return Column(name, "", "", "holds no numbers", np.nan, np.nan, 0.0, 1.0)
    finite = values[np.isfinite(values)]
    low, high = float(finite.min()), float(finite.max())
    step, missing = grid_step(values), 1.0 - finite.size / values.size
    if told is None:
        return Column(name, "", "", "the name is not recognised", low, high, step, missing)
    both = finite if beside is None else np.concatenate([finite, beside[np.isfinite(beside)]])
    whole = bool((both == np.round(both)).all())
    unit, why = time_unit, "" if time_unit == "s" else f"only in {time_unit} the rate is that of a joint's log"
    if told.unit:
        unit, why = told.unit, f"{told.unit_by} states {told.unit}"
    elif told.unknown_unit and not (whole and told.unknown_unit.lower() in COUNTS):
        unit, why = "", f"{told.unit_by} states {told.unknown_unit}, which is not among the units of this quantity"
    elif told.by in DUTY_CYCLE:
        unit, why = "", "a duty cycle: its unit is the voltage [V] of one step of it, 0.12 for percent of 12 V"
    elif told.quantity != "time":
        unit, why = (
            ("rpm", "") if "rpm" in told.by else _unit(told.quantity, float(both.min()), float(both.max()), whole=whole)
        )
    if told.quantity == "enabled":
        unit, why = "", "0 while the drive is off"
    canonical = "time" if told.quantity == "time" else f"{told.joint or NAMELESS}/{told.quantity}"
    if told.quantity == "enabled" and not told.joint:
        canonical = "enabled"
    alias = f"alias {told.by}" if told.by else "recognised by its unit"
    by = "canonical name" if name == canonical else alias
    return Column(name, canonical, unit, f"{by}; {why}" if why else by, low, high, step, missing)


def _unit(quantity: str, low: float, high: float, *, whole: bool) -> tuple[str, str]:
    """The unit that values seem to be in ("" where nobody can tell), and why it is not SI."""
    span, largest = high - low, max(abs(low), abs(high))
    if quantity in ("position", "position_command", "motor_position"):
        if span <= MOST_TURNS and not (whole and largest > MOST_TURNS):
            return "rad", ""
        if whole and span > 0.0:
            counts = 2 ** max(10, int(np.ceil(np.log2(largest + 1.0))))
            return f"{2.0 * np.pi / counts:.10g}", f"whole numbers: encoder counts, perhaps {counts} a turn"
        if largest < MOST_DEGREES:
            return "deg", f"spans {span:.4g}, which in rad would be more than two turns"
        return "", f"spans {span:.4g}, which is too much for rad and deg"
    if quantity == "velocity" and largest > FASTEST:
        return "", f"reaches {largest:.4g}, which is too fast for rad/s"
    if quantity == "current" and largest > MOST_AMPERES:
        return "mA", f"reaches {largest:.4g}, which is too large for A"
    if quantity in ("voltage", "supply_voltage") and largest > MOST_VOLTS:
        return "mV", f"reaches {largest:.4g}, which is too large for V"
    return SI.get(quantity, ""), ""
