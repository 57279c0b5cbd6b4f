"""A torque column whose unit the declared rotor inertia contradicts: unstated, stated wrongly, or given as a factor."""

import numpy as np
import pandas as pd
import pytest

from drake_tc.errors import LogError
from drake_tc.logs.prepare import load_runs
from drake_tc.logs.rig import parse_rig

INERTIA, GAIN = 0.31, 0.05
T = 2e-3 * np.arange(6000)


def log(folder, scale):
    """A joint under a load torque of two sines, which the log has `scale` times as large, and its current."""
    waves = ((0.5, 3.1, 0.0), (0.2, 7.7, 1.0))
    q = sum(a * np.sin(w * T + p) for a, w, p in waves)
    v = sum(a * w * np.cos(w * T + p) for a, w, p in waves)
    acceleration = -sum(a * w**2 * np.sin(w * T + p) for a, w, p in waves)
    load = 6.0 * np.sin(1.3 * T) + 3.0 * np.cos(4.3 * T)
    current = GAIN * (load + INERTIA * acceleration + 1.5 * v + 0.8 * np.sign(v))
    path = folder / "run.csv"
    columns = {"time": T, "joint/position": q, "joint/current": current, "joint/torque": scale * load}
    pd.DataFrame(columns).to_csv(path, index=False)
    return path


def read(folder, scale, unit=None):
    document = {"joint": "joint", "drive": "current", "declared": {"rotor_inertia": INERTIA}}
    document |= {} if unit is None else {"units": {"torque": unit}}
    return load_runs([log(folder, scale)], parse_rig(document))


@pytest.mark.parametrize(
    ("scale", "unit", "said"),
    [
        (1e3, None, "is in mN*m; set units: {torque: mN*m} in the rig file (or torque: N*m if it is right)"),
        (1e3, "N*m", "is in mN*m and not in N*m; set units: {torque: mN*m} in the rig file (or torque: 1, the factor"),
        (1.0, "mN*m", "is in N*m and not in mN*m; set units: {torque: N*m} in the rig file (or torque: 0.001, the"),
        (-1e3, "-N*m", "is in mN*m and not in N*m; set units: {torque: -mN*m}"),
    ],
)
def test_a_wrong_unit_is_refused_in_one_line_with_both_units(tmp_path, scale, unit, said):
    with pytest.raises(LogError) as told:
        read(tmp_path, scale, unit)
    assert said in str(told.value) and "'joint/torque'" in str(told.value) and "\n" not in str(told.value)


@pytest.mark.parametrize(
    ("scale", "unit"),
    [
        (1.0, None),
        (1.0, "N*m"),
        (1e3, "mN*m"),
        (1e3, 1.0),  # a stated factor is believed
        (10.1972, "N*m"),  # and so is a stated name, but for the factor of 1000
    ],
)
def test_what_is_right_or_stated_is_believed(tmp_path, scale, unit):
    (run,) = read(tmp_path, scale, unit)
    assert np.isfinite(run.columns["joint/torque"]).all()
