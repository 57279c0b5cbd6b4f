"""Input files: one strict reader, models of what a file may say, messages, schemas, pages; and writing of results."""
