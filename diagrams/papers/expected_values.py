"""Where the expected values of each reproduction are: `PAPER/expected/FILE.yaml`, a folder a paper."""

from pathlib import Path

from drake_tc.report.figure_row import Expectation, OnRecord, read_expectations, read_on_record

FOLDERS = {"a": "delprete2016", "b": "delprete2015", "c": "faraji2015"}
"""First letter of a reproduction's id to the folder of its paper."""


def expected_file(id_: str) -> str:
    """Stem of the expected file of a reproduction: `a_table2` of `A.table2`."""
    return id_.lower().replace(".", "_")


def expected_path(file: str) -> Path:
    """The expected file of that stem, such as `a_table2`."""
    return Path(__file__).parent / FOLDERS[file[0]] / "expected" / f"{file}.yaml"


def expectations(file: str) -> dict[str, Expectation]:
    """What each row of a reproduction should be, by name.

    Raises:
        ParamsError: see `read_expectations`.
    """
    return read_expectations(expected_path(file))


def on_record(file: str) -> dict[str, OnRecord]:
    """The values on record of a reproduction, by name.

    Raises:
        ParamsError: see `read_on_record`.
    """
    return read_on_record(expected_path(file))
