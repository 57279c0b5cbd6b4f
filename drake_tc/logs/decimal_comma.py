"""Numbers with a decimal comma, as spreadsheets write them where the comma is the decimal sign."""

import re

import numpy as np
import pandas as pd

_NUMBER = re.compile(r"\s*[+-]?(\d+(,\d*)?|,\d+)([eE][+-]?\d+)?\s*")


def with_decimal_points(table: pd.DataFrame, separator: str) -> pd.DataFrame:
    """The table with numbers in place of texts such as '0,25', and a note that names their columns.

    A column is read so if all of its filled cells are such numbers. Texts with points and commas ('1.234,5') stay:
    which of the two marks thousands is not known.

    Args:
        table: Of a CSV file.
        separator: Of its cells; where it is the comma, no number holds one.
    """
    if separator == ",":
        return table
    read = []
    for name in table.columns:
        if not (pd.api.types.is_object_dtype(table[name].dtype) or pd.api.types.is_string_dtype(table[name].dtype)):
            continue
        cells = table[name].to_numpy(dtype=object)
        filled = np.array([isinstance(cell, str) and cell.strip() != "" for cell in cells], dtype=np.bool_)
        texts = [str(cell) for cell in cells[filled]]
        if any(not isinstance(cell, str) and not pd.isna(cell) for cell in cells):
            continue
        if texts and any("," in text for text in texts) and all(map(_NUMBER.fullmatch, texts)):
            numbers = np.full(cells.size, np.nan)
            numbers[filled] = [float(text.replace(",", ".")) for text in texts]
            table[name] = numbers
            read.append(str(name))
    if read:
        note = f"The numbers of {', '.join(map(repr, read))} have a decimal comma, and were read so."
        table.attrs["notes"] = [*table.attrs.get("notes", ()), note]
    return table
