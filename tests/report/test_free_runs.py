"""Free runs in the report: the refinement on them, the errors of each run, and why a run has no error figure."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from mailed import Undrawn

from drake_tc.actuation.model import ActuatorModel, Drive
from drake_tc.cli.close_loop_command import print_summary
from drake_tc.diagnosis.notes import FreeRunDiverges, NoFreeRun
from drake_tc.diagnosis.result.errors import with_free_runs
from drake_tc.diagnosis.result.joint_result import JointResult, RefinedParameter, Refinement
from drake_tc.diagnosis.result.rig_result import CloseLoopResult
from drake_tc.report.data_files import free_runs_json, refinement_json
from drake_tc.report.html import render
from drake_tc.report.notes import note_sentence, warnings
from drake_tc.report.plots.time_plots import position_plot
from drake_tc.report.sections import WHY_NOT, refinement_section, refinement_sentence
from drake_tc.report.tables import free_run_table

ACCEPTED = Refinement(
    "accepted",
    model=ActuatorModel("knee", Drive("current", 0.1)),
    parameters=(RefinedParameter("coulomb", "coulomb", "N*m", 1.5, 1.7512, at_bound=True),),
    train=(0.02, 0.005),
    cross_validated=(0.021, 0.008),
    error_train=0.1,
    error_heldout=0.12,
    free_run_heldout=0.006,
)


def refined(joint: JointResult) -> JointResult:
    trace = joint.free_run["fast"]
    off = trace["recorded"] + np.where(np.arange(trace["recorded"].size) % 2, 0.003, -0.001)
    return replace(joint, refinement=ACCEPTED, free_run={"fast": {**trace, "refined": off}})


def test_errors_of_a_run_are_those_of_its_trace(joint: JointResult) -> None:
    (row,) = free_runs_json(refined(joint))
    assert row["refined"] == {"rms": pytest.approx(np.sqrt(5e-6)), "mean_absolute": pytest.approx(2e-3)}


def test_a_joint_without_a_refinement_has_none(joint: JointResult) -> None:
    assert refinement_json(joint.refinement) is None
    assert refinement_section(joint) is None
    (row,) = free_runs_json(joint)
    assert row["refined"] is None


def test_the_page_shows_errors_numbers_and_what_the_verdict_rests_on(
    result: CloseLoopResult, joint: JointResult
) -> None:
    page = render(replace(result, joints={"knee": refined(joint)}), Undrawn())
    assert "<h2>Refinement on free runs</h2>" in page
    sentence = refinement_sentence(ACCEPTED)
    assert sentence in page
    for said in ("model_refined.yaml", "20.0", "5.00", "21.0", "8.00", "In cross-validation"):
        assert said in sentence
    assert "1.751" in page and "at bound" in page
    assert "The verdict, the effects and their intervals are those of the model after" in page
    assert "RMS refined" in page and "2.00\u00a0mrad" in page


def test_the_plot_over_time_has_a_line_for_the_refined_model(joint: JointResult) -> None:
    plots = [position_plot(each, "j0", 10_000) for each in (joint, refined(joint))]
    without, found = (set() if plot is None else set(plot.data["runs"][0]) for plot in plots)
    assert found - without == {"refined"}
    assert plots[1] is not None and "model refined" in plots[1].picture


def test_models_that_were_not_simulated_have_no_column(joint: JointResult) -> None:
    table = free_run_table(joint)
    assert "refined" not in table["models"]
    ((run, role, rms, absolute),) = free_run_table(refined(joint))["rows"]
    assert (run, role, rms[-1], absolute[-1]) == ("fast", "held-out", "2.24\u00a0mrad", "2.00\u00a0mrad")


@pytest.mark.parametrize("status", [s for s in WHY_NOT if s != "accepted"])
def test_a_model_that_stays_says_why(status: str) -> None:
    said = refinement_sentence(Refinement(status, why="It is 3 N*m." if status == "implausible" else ""))  # type: ignore[arg-type]
    assert said.startswith("No refined model was written: ")
    assert ("(It is 3 N*m)" in said) == (status == "implausible")


@pytest.mark.parametrize(("after", "said"), [(0.0058, True), (0.00589, False), (None, False)])
def test_a_refined_model_that_follows_the_held_out_runs_worse_is_warned_of(
    joint: JointResult, after: float | None, said: bool
) -> None:
    made = replace(refined(joint), after=replace(joint.after, free_run_heldout=after))
    assert any("prefer the model after" in each for each in warnings(made)) == said


HELD = [SimpleNamespace(name="fast"), SimpleNamespace(name="slow")]
TIME = np.arange(3.0)


def test_a_model_without_inertia_is_said_to_have_no_free_run(joint):
    made = with_free_runs(joint, None, HELD, lambda *_: None, None)
    assert made.before.free_run_heldout is None and made.after.free_run_heldout is None
    (note,) = set(made.notes) - set(joint.notes)
    assert note == NoFreeRun("no_inertia")
    assert note in made.load_notes


def test_runs_on_which_a_model_diverges_are_named(joint, capsys, tmp_path):
    many = max(len(joint.baseline.terms), len(joint.final.terms))

    def simulated(model, rig, name, run):
        lost = run.name == "slow" and len(model.effects) >= many  # the model after
        return TIME, TIME, np.array([0.0, 1.0, np.nan]) if lost else TIME + 0.5

    made = with_free_runs(joint, None, HELD, simulated, None)
    assert made.before.free_run_heldout == 0.5
    assert made.after.free_run_heldout is None
    (note,) = set(made.notes) - set(joint.notes)
    assert note == FreeRunDiverges("after", ("slow",))
    print_summary(CloseLoopResult({"knee": made}, made.verdict, 1.0, (), (), "rig.yaml"), tmp_path)
    out = " ".join(capsys.readouterr().out.split())
    assert note_sentence(note) in out and "nan" not in out
