"""Logs and rigs: read files, map columns and units, check, repair, and put runs on a uniform clock."""
