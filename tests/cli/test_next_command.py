"""The line `next: ...` that `inspect` and `check` end with: it can be run as it is printed."""

import shlex

import pytest


def next_words(line: str) -> list[str]:
    """Words of the drake-tc command in a line on stderr, without the program's name."""
    words = shlex.split(line)
    assert words[0] == "next:"
    return words[words.index("drake-tc") + 1 :]


@pytest.mark.usefixtures("fits_nothing")
def test_from_a_log_to_the_command_that_diagnoses_it(invoke, short_log, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    done = invoke("inspect", short_log)
    words = next_words(done.err.splitlines()[-1])
    assert words[:4] == ["inspect", str(short_log), "--rig", "rig.yaml"]
    done = invoke(*words[:4])
    assert done.code == 0 and done.out.splitlines()[-1] == "rig.yaml"
    words = next_words(done.err.splitlines()[-1])
    done = invoke(*words)
    assert done.code == 0
    words = next_words(done.err.splitlines()[-1])
    assert words[:7] == ["close-loop", "--rig", "rig.yaml", "--log", str(short_log), "--holdout", "RUN"]


def test_a_document_has_no_such_line(invoke, bench):
    assert "next:" not in invoke("inspect", bench.logs[0], "--json").err
