"""`bench qp` times the solvers on the problems of its motions."""

import json

from tests.benchmarks.__main__ import run
from tests.benchmarks.qp import MOTIONS


def test_the_command_prints_rows(capsys):
    assert run(["qp", "--solver", "daqp", "--ticks", "20", "--json"]) == 0
    printed = json.loads(capsys.readouterr().out)
    assert printed["name"] == "qp" and len(printed["rows"]) == 2 * 3 * len(MOTIONS)
    assert {"name", "unit", "median", "p99", "n"} == set(printed["rows"][0])
    assert run(["qp", "--solver", "simplex", "--ticks", "20"]) == 2
    assert "expected one of" in capsys.readouterr().err
