"""The AK80-9 bench: channels one row apart, and the torque of held-out logs against the published model."""

from pathlib import Path

import numpy as np
import pytest
from readme_quotes_real import differing_cells

from drake_tc.bench.real_tmotor import LOWER_BY, held_out, published_features, rows
from drake_tc.logs.importers.tmotor import SESSIONS, convert
from drake_tc.logs.readers import read_table


@pytest.fixture(scope="module")
def folder(data: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    out = tmp_path_factory.mktemp("tmotor")
    convert(data / "tmotor-ak80-9-bench", out)
    return out


@pytest.mark.parametrize("name", ["sysid_final_trial5", "sysid_opposing_motor_2", "sysid_torque_rampup"])
def test_after_the_import_torque_and_current_are_of_the_same_instant(folder: Path, name: str) -> None:
    session = next(s for s, names in SESSIONS.items() if name in names)
    table = read_table(folder / session / f"{name}.parquet")
    torque, current = (np.diff(table[f"actuator/{c}"].to_numpy()) for c in ("torque", "current"))
    lags = range(-3, 4)
    match = [float(np.dot(torque[5:-5], np.roll(current, lag)[5:-5])) for lag in lags]
    assert lags[int(np.argmax(match))] == 0


def test_inertia_brings_the_swung_log_far_below_the_published_model(data: Path) -> None:
    result = held_out(data, ("sysid_test_1",))["sysid_test_1"]
    assert "rotor_inertia" in result.found
    error = result.torque_error(result.chosen)
    assert error <= (1.0 - LOWER_BY) * result.torque_error_of(published_features)


@pytest.mark.slow
def test_the_readme_quotes_what_is_computed(data: Path) -> None:
    assert differing_cells("real-tmotor", {row.name: row for row in rows(data)}) == []
