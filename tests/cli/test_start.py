"""What a command loads before it runs: names and options, not the libraries that compute."""

import json
import subprocess
import sys

HEAVY = ("scipy", "pandas", "sklearn", "matplotlib", "pydrake.multibody.plant", "pyarrow", "drake_tc.diagnosis.run")


def loaded_by(statement: str) -> list[str]:
    """Which heavy modules a fresh process has after a statement."""
    code = f"import json, sys\n{statement}\nprint(json.dumps([m for m in {HEAVY!r} if m in sys.modules]))"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    return json.loads(done.stdout)


def test_the_command_line_computes_nothing_before_it_knows_the_command():
    assert loaded_by("import drake_tc, drake_tc.cli.main") == []


def test_a_worker_that_simulates_loads_neither_tables_nor_learning_nor_plots():
    workers = "import drake_tc.loops.joint_bench, drake_tc.identification.output_error"
    assert not {"pandas", "sklearn", "matplotlib"} & set(loaded_by(workers))


def test_the_module_of_a_command_is_the_one_that_is_missing_here():
    assert set(loaded_by("import drake_tc.diagnosis.run")) >= {"scipy", "pandas", "drake_tc.diagnosis.run"}
