"""Tables of the commands, on paper and on terminals."""

import io

import pytest

from drake_tc.cli.terminal import print_wide

ROWS = [("backlash", "1.1", "not separable from torque_sensor_bias and encoder_offset"), ("delay", "12", "")]
HEADINGS, LEFT = ("effect", "size", "why"), ("effect", "why")


class Terminal(io.StringIO):
    def isatty(self) -> bool:
        return True


def _printed(file: io.StringIO, columns: int, monkeypatch: pytest.MonkeyPatch) -> list[str]:
    monkeypatch.setenv("COLUMNS", str(columns))
    monkeypatch.setenv("TERM", "xterm")
    print_wide(HEADINGS, ROWS, LEFT, file=file)
    return file.getvalue().splitlines()


def test_in_a_file_every_row_is_one_line_without_blanks_at_its_end(monkeypatch):
    lines = _printed(io.StringIO(), 40, monkeypatch)
    assert len(lines) == 1 + len(ROWS) and all(line == line.rstrip() for line in lines)
    assert all(cell in line for line, row in zip(lines[1:], ROWS, strict=True) for cell in row)


def test_a_narrow_terminal_wraps_the_last_text_and_nothing_else(monkeypatch):
    lines = _printed(Terminal(), 40, monkeypatch)
    assert max(map(len, lines)) <= 40 and len(lines) > 1 + len(ROWS)
    why = " ".join(line[lines[0].index("why") :].strip() for line in lines[1:-1])
    assert why == ROWS[0][2] and lines[-1].split() == ["delay", "12"]


def test_where_no_text_fits_every_row_is_a_paragraph_within_the_terminal(monkeypatch):
    lines = _printed(Terminal(), 25, monkeypatch)
    assert max(map(len, lines)) <= 25
    assert [line for line in lines if not line.startswith(" ")] == ["backlash", "delay"]
    assert " ".join(line.strip() for line in lines[1:-2]) == f"size: 1.1; why: {ROWS[0][2]}"
    assert lines[-1].strip() == "size: 12"
