"""Experiments before, beside and after a diagnosis: what logs can show, what to record next, what would be found."""
