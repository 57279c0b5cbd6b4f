"""Figures in the README files' tables are those on record, which slow tests compare with what is computed."""

import re

import pytest
from readme_quotes_coman import COMAN, STANDS, stands_or_falls
from readme_quotes_pages import OTHER_PAGES
from readme_tables import assert_quoted, row

QUOTES = [*OTHER_PAGES, *COMAN]


@pytest.mark.parametrize(("file", "begin", "cell", "values"), QUOTES, ids=[f"{q[0]}: {q[1]}, {q[2]}" for q in QUOTES])
def test_a_table_quotes_what_is_on_record(file, begin, cell, values):
    assert_quoted(row(file, begin)[cell], values(), f"{file}: {begin}")


@pytest.mark.parametrize(("file", "begin", "cell", "loops"), STANDS)
def test_a_table_says_what_stands_and_falls_on_record(file, begin, cell, loops):
    assert re.findall(r"\b(?:stands|falls)\b", row(file, begin)[cell]) == stands_or_falls(loops)
