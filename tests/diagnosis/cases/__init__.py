"""The physical cases of the diagnosis as a table: `python -m tests.diagnosis.cases` prints it."""
