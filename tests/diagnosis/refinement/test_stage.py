"""The refinement on free runs: where the equation error is biased, where there is nothing to gain, and its choices.

The joints are simulated by `stick_slip`, which shares no code with the library.
"""

from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from numpy.testing import assert_allclose

from drake_tc.actuation.model_file import load_models
from drake_tc.cli.close_loop_command import write_results
from drake_tc.diagnosis.diagnose import diagnose_joint
from drake_tc.diagnosis.options import DiagnosisOptions
from drake_tc.diagnosis.refinement import equation_errors, refine_joint
from drake_tc.diagnosis.result.errors import with_free_runs
from drake_tc.diagnosis.result.joint_result import JointResult, Refinement, named_values
from drake_tc.diagnosis.result.models import model_of
from drake_tc.diagnosis.result.rig_result import CloseLoopResult
from drake_tc.diagnosis.run import close_loop
from drake_tc.logs.record import Run
from drake_tc.logs.rig import save_rig
from drake_tc.loops.joint_bench import rig_free_run
from drake_tc.report.data_files import joint_json
from drake_tc.report.sections import refinement_section, refinement_sentence

from ..stick_slip import JOINT, Servo, rig_of, runs_of

DECLARED_ONLY = DiagnosisOptions(effects=(), assess_residual=False)
"""No search: the true joint has no effect beyond the declared ones."""
NOISY = Servo(encoder_noise=4e-3)
"""An encoder of 12 bits with noise of 4 mrad."""


def diagnosed(servo: Servo, train: Sequence[Run], held: Sequence[Run]) -> JointResult:
    return diagnose_joint(train, held, rig_of(servo), JOINT, DECLARED_ONLY)


def with_half_its_inertia(result: JointResult) -> JointResult:
    """The model after as the noise of the acceleration leaves it where it is not corrected."""
    own = dict(result.final_parameters)
    inertia = own["rotor_inertia"]["rotor_inertia"]
    own["rotor_inertia"] = {"rotor_inertia": replace(inertia, value=0.5 * inertia.value)}
    return replace(result, final_parameters=own)


@pytest.fixture(scope="module")
def noisy() -> tuple[JointResult, Refinement, list[Run], list[Run]]:
    train, held = runs_of(NOISY)
    result = with_half_its_inertia(diagnosed(NOISY, train, held))
    return result, refine_joint(result, rig_of(NOISY), train), train, held


def test_output_error_finds_the_inertia_that_the_equation_lacks(
    noisy: tuple[JointResult, Refinement, list[Run], list[Run]],
):
    result, found, _, _ = noisy
    assert found.status == "accepted" and found.model is not None
    biased, refined = named_values(model_of(result, final=True)), named_values(found.model)
    assert biased["rotor_inertia"]["rotor_inertia"] < 0.6 * NOISY.inertia
    assert_allclose(refined["rotor_inertia"]["rotor_inertia"], NOISY.inertia, rtol=0.1)
    assert_allclose(refined["drive"]["gain"], 1.0 / NOISY.stiffness, rtol=0.02)
    assert_allclose(refined["coulomb"]["coulomb"], NOISY.coulomb, rtol=0.05)
    assert_allclose(refined["viscous"]["viscous"], NOISY.viscous, rtol=0.1)


def test_the_held_out_free_run_follows_and_every_output_has_it(
    noisy: tuple[JointResult, Refinement, list[Run], list[Run]],
):
    result, found, _, held = noisy
    whole = with_free_runs(replace(result, refinement=found), rig_of(NOISY), held, rig_free_run, None)
    document = joint_json(whole)
    (row,) = document["free_runs"]
    noise = NOISY.encoder_noise * np.sqrt(2.0 / np.pi)  # mean absolute value of what no model can follow
    assert row["refined"]["mean_absolute"] - noise < 0.5 * (row["after"]["mean_absolute"] - noise)
    assert row["refined"]["rms"] == pytest.approx(document["refinement"]["error"]["free_run_heldout"], rel=1e-12)
    assert document["error"]["after"]["free_run_heldout"] == pytest.approx(row["after"]["rms"], rel=1e-12)
    assert document["refinement"]["model"] == "model_refined.yaml"
    assert document["refinement"]["error"]["heldout"] > 0.0
    assert {p["parameter"] for p in document["refinement"]["parameters"]} == {
        "gain",
        "viscous",
        "coulomb",
        "rotor_inertia",
    }
    section = refinement_section(whole)
    assert section is not None
    assert "model_refined.yaml follows the recorded position more closely" in section["sentence"]
    assert whole.verdict == result.verdict  # the verdict is that of the equation error


def test_the_same_numbers_every_time_and_beside_each_other(
    noisy: tuple[JointResult, Refinement, list[Run], list[Run]],
):
    result, found, train, _ = noisy
    with ThreadPoolExecutor(2) as pool:
        again = refine_joint(result, rig_of(NOISY), train, pool)
    assert again == found


def test_the_fits_own_numbers_have_its_own_equation_error(
    noisy: tuple[JointResult, Refinement, list[Run], list[Run]],
):
    _, found, train, held = noisy
    result = diagnosed(NOISY, train, held)
    own = {key: {n: e.value for n, e in group.items()} for key, group in result.final_parameters.items()}
    splits = (result.train, result.heldout)
    assert_allclose(equation_errors(result.final, own, splits), [result.after.train, result.after.heldout], rtol=1e-6)
    assert found.error_train is not None
    assert found.error_train > 0.999 * result.after.train  # least squares of the equation is best at its own rows


def test_a_model_that_follows_as_well_as_the_encoder_resolves_stays():
    servo = Servo()
    train, held = runs_of(servo)
    found = refine_joint(diagnosed(servo, train, held), rig_of(servo), train)
    assert found.status == "resolved" and found.model is None
    assert "No refined model was written" in refinement_sentence(found)


def test_a_refinement_that_does_not_carry_over_to_other_runs_is_rejected():
    """Two runs of two servos: what follows the one does not follow the other."""
    other = replace(NOISY, stiffness=1.8, coulomb=0.3)
    (first, *_), held = runs_of(NOISY)
    train = [first, runs_of(other)[0][1]]
    found = refine_joint(diagnosed(NOISY, train, held), rig_of(NOISY), train)
    assert found.status == "no_gain" and found.model is None
    assert found.train is not None and found.train[1] < found.train[0]
    assert found.cross_validated is not None
    assert found.cross_validated[1] > 0.95 * found.cross_validated[0]
    assert "in cross-validation" in refinement_sentence(found)


def test_runs_that_no_numbers_follow_are_not_searched_further(
    noisy: tuple[JointResult, Refinement, list[Run], list[Run]],
):
    """Each run goes its own way, by up to half a radian."""
    result, _, train, _ = noisy
    rng = np.random.default_rng(5)
    column = f"{JOINT}/position"
    apart = []
    for run in train:
        knots = np.interp(run.time, np.linspace(0.0, run.time[-1], 9), 0.5 * rng.uniform(-1.0, 1.0, 9))
        apart.append(replace(run, columns={**run.columns, column: run.columns[column] + knots}))
    found = refine_joint(result, rig_of(NOISY), apart)
    assert found.status == "no_gain" and found.model is None and found.cross_validated is None


def written(folder: Path, runs: Sequence[Run]) -> list[Path]:
    paths = []
    for run in runs:
        paths.append(folder / f"{run.name}.csv")
        pd.DataFrame({"time": run.time, **run.columns}).to_csv(paths[-1], index=False)
    return paths


def test_from_files_in_any_order_to_the_same_refinement(tmp_path: Path):
    servo = replace(NOISY, duration=5.0)
    train, held = runs_of(servo)
    logs, (holdout,) = written(tmp_path, train), written(tmp_path, held)
    rig = save_rig(rig_of(servo), tmp_path / "rig.yaml")
    first, other = (close_loop(rig, order, [holdout], DECLARED_ONLY, rig_free_run) for order in (logs, logs[::-1]))
    assert first.joints[JOINT].refinement == other.joints[JOINT].refinement is not None


def test_a_refined_model_has_a_file_of_its_own(
    noisy: tuple[JointResult, Refinement, list[Run], list[Run]], tmp_path: Path
):
    result, found, _, _ = noisy
    assert found.model is not None
    refined = replace(result, refinement=found)
    whole = CloseLoopResult({JOINT: refined}, result.verdict, 1.0, ("one.csv",), ("held.csv",), "rig.yaml")
    write_results(whole, tmp_path)
    assert load_models(tmp_path / "model_refined.yaml")[JOINT].drive.gain == pytest.approx(found.model.drive.gain)
    after = load_models(tmp_path / "model_after.yaml")[JOINT]
    assert after.drive.gain == pytest.approx(result.final_parameters["drive"]["gain"].value)
    write_results(replace(whole, joints={JOINT: replace(result, refinement=Refinement("no_gain"))}), tmp_path)
    assert not (tmp_path / "model_refined.yaml").exists()  # no stale file of the call before
