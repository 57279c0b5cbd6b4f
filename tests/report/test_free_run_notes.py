"""A free run without an error figure says why, on the console and in the report."""

from types import SimpleNamespace

import numpy as np

from drake_tc.cli.close_loop_summary import print_summary
from drake_tc.diagnosis.notes import FreeRunDiverges, NoFreeRun
from drake_tc.diagnosis.result.errors import with_free_runs
from drake_tc.diagnosis.result.rig_result import CloseLoopResult
from drake_tc.report.notes import note_sentence

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
