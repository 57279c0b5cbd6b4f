"""The AK80-9 bench: channels one row apart, and the torque of held-out logs against the published model."""

from pathlib import Path

import numpy as np
import pytest
from readme_quotes_real import differing_cells

from drake_tc.benchmarks.flexible_fits import offset_of, repeatability
from drake_tc.benchmarks.real_tmotor import CASES, LOWER_BY, held_out, rows
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
    found = held_out(data, ("sysid_test_1",))["sysid_test_1"]
    assert "rotor_inertia" in {effect.id for effect in found.result.effects}
    assert found.after <= 0.1  # the published model, fitted on the same logs, leaves 0.24 N m


@pytest.mark.slow
def test_what_the_logs_can_tell_and_the_readme_quotes_it(data: Path) -> None:
    table = {row.name: row for row in rows(data)}
    assert differing_cells("real-tmotor", table) == []
    assert table["sysid_test_1/found_model"].met
    for name in CASES:
        if name != "sysid_test_1":  # no fit on the other logs reaches it, although it is chosen in view of this log
            assert table[f"{name}/best_fit_ratio"].value > 1.0 - LOWER_BY


@pytest.mark.slow
def test_one_log_has_another_zero_of_the_torque_sensor(data: Path) -> None:
    logs = {name: each.rows for name, each in held_out(data).items()}
    offsets = {name: offset_of(log) for name, log in logs.items()}
    odd = offsets.pop("sysid_torque_rampup")
    assert odd - max(offsets.values()) > 0.2
    pool = [log for name, log in logs.items() if name != "sysid_torque_rampup"]
    within, between = (repeatability(logs["sysid_torque_rampup"], others)[0] for others in ((), pool))
    assert between > 2.0 * within
