"""An export that is tried without a file: the errors of the run, the sentences of the loss, and what is refused."""

from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from drake_tc.actuation.model import ActuatorModel, Drive, EffectValue
from drake_tc.errors import ParamsError
from drake_tc.exchange.trial import recorded_speeds, require_runner, try_export
from drake_tc.logs.record import Run
from drake_tc.logs.rig import parse_rig

from .test_target_runs import COULOMB, SERVO, recorded


def test_speeds_are_those_of_usable_rows():
    time = np.arange(2000) * 1e-3
    segment = np.where(time < 1.0, 0, -1)
    run = Run("r", None, time, 1e-3, {"joint/position": np.where(time < 1.0, 0.5 * time, 9.0)}, segment)
    rig = parse_rig({"joint": "joint", "drive": "position_servo", "load": "torque"}, "rig.yaml")
    (found,) = recorded_speeds([run, run], rig, ["joint", "other"]).values()
    assert found.size == 2000
    np.testing.assert_allclose(np.median(found), 0.5, rtol=1e-9)


def test_loads_of_a_robots_model_are_refused():
    with pytest.raises(ParamsError, match="loads that the model of a robot computes"):
        require_runner("drake-urdf", SimpleNamespace(robot=Path("leg.yaml")))


def test_effects_without_a_place_are_named_by_their_titles_and_seen_in_the_error():
    lost = (COULOMB, EffectValue("deadzone", {"deadzone": 1e-3}))
    model = ActuatorModel("joint", Drive("position_servo", 2e-3), (*SERVO, *lost))
    rig, run = recorded(model)
    trial = try_export({"joint": model}, "model_after.yaml", "drake-urdf", rig, ([run], [run]), None)
    (row,) = trial.rows
    assert row.export > 5.0 * row.model and row.original is None and trial.runner == "Drake's plant"
    assert any("Coulomb friction" in loss for loss in trial.losses)
    assert any(loss.startswith("joint: Drake (URDF) has no dead zone of the drive: ") for loss in trial.losses)
