"""The AK80-9 bench: channels one row apart, and the torque of held-out logs against the published model."""

from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
import pytest

from drake_tc.diagnosis.options import DiagnosisOptions
from drake_tc.diagnosis.run import close_loop
from drake_tc.errors import IdentificationError
from drake_tc.logs.files.readers import read_table
from tests.benchmarks.figures import BenchmarkRow
from tests.benchmarks.importers.tmotor import SESSIONS, convert
from tests.benchmarks.real_log_cases import case_files, import_set
from tests.benchmarks.real_logs import chosen_sets
from tests.benchmarks.real_tmotor import DATA_SET, LOWER_BY, held_out, rows


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


@pytest.mark.slow
def test_inertia_brings_the_swung_log_far_below_the_published_model(data: Path) -> None:
    found = held_out(data, ("sysid_test_1",))["sysid_test_1"]
    assert "rotor_inertia" in {effect.id for effect in found.result.effects}
    assert found.after <= 0.1  # the published model, fitted on the same logs, leaves 0.24 N m


@pytest.fixture(scope="module")
def table(data: Path) -> dict[str, BenchmarkRow]:
    return {row.name: row for row in rows(data)}


@pytest.mark.slow
def test_what_the_logs_can_tell(table: dict[str, BenchmarkRow]) -> None:
    assert table["sysid_test_1/found_model"].met
    fast = "sysid_test_high_speed"
    assert table[f"{fast}/found_model_zeroed"].value <= table[f"{fast}/found_model"].expected
    # no fit on the other logs reaches the third, though it is chosen in view of this log
    assert table["sysid_opposing_motor_2/best_fit_ratio"].value > 1.0 - LOWER_BY


@pytest.mark.slow
@pytest.mark.xfail(strict=True, reason="missed: the sensor's zero is withdrawn, noise could add it")
def test_the_log_of_high_speed_meets_the_goal_too(table: dict[str, BenchmarkRow]) -> None:
    assert table["sysid_test_high_speed/found_model"].met


def test_the_log_that_mostly_stalls_is_refused(data: Path) -> None:
    """Its speed has the spread of its own noise: faster than the sensor resolves for half a second of 25 s."""
    (chosen,) = chosen_sets([DATA_SET])
    case = next(case for case in chosen.cases if case.name == "early/rampup_held_out")
    with TemporaryDirectory() as scratch:
        files = case_files(chosen, case, import_set(chosen, data, Path(scratch)), Path(scratch))
        with pytest.raises(IdentificationError, match=r"held-out runs: .*sysid_torque_rampup: too little motion"):
            close_loop(files.rig, files.log, files.holdout, DiagnosisOptions(assess_residual=False))
