"""Public logs of an arm, one of them with a known load at the flange that the rig file does not declare."""

import pytest
from numpy.testing import assert_allclose

from drake_tc.diagnosis.robot import whole
from drake_tc.diagnosis.run import close_loop
from drake_tc.diagnosis.set_up.search import check_set_up
from tests.benchmarks.importers.ur10e import convert

MASS = 2.805
"""By the authors of the data [kg]."""
EMPTY = ("exc_30s_12harm", "exc_20s_8harm", "exc_20s_12harm", "exc_0131_unload")
LOADED = "exc_0131_load"


class Looked(Exception):
    """Ends a diagnosis once the set-up has been looked at."""


@pytest.mark.slow
@pytest.mark.parametrize(
    ("train", "held", "found"),
    [
        ((*EMPTY, LOADED), ("exc_40s_12harm", "val_ptp_10_points"), True),
        (EMPTY, (LOADED, "val_ptp_10_points"), True),
        ((LOADED,), ("exc_0131_unload",), True),
        (EMPTY, ("exc_40s_12harm", "val_ptp_10_points"), False),
    ],
)
def test_the_loaded_log_is_named_with_its_mass(train, held, found, data, monkeypatch, tmp_path):
    seen = []

    def spy(*arguments):
        seen.append(check_set_up(*arguments))
        raise Looked

    monkeypatch.setattr(whole, "check_set_up", spy)
    convert(data / "ur10e-calibration", tmp_path)
    logs, held_out = ([tmp_path / f"{name}.parquet" for name in names] for names in (train, held))
    with pytest.raises(Looked):
        close_loop(tmp_path / "rig.yaml", logs, held_out)
    (check,) = seen
    assert (check is not None) == found
    if check is not None:
        (error,) = check.errors
        assert (error.kind, error.runs, error.carrier) == ("payload", (LOADED,), "wrist_3_link")
        assert_allclose(error.mass, MASS, rtol=0.03)
        assert check.alternatives == ()
