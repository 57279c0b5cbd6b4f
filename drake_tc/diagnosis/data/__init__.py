"""Rows and filters: from recorded runs to the samples that a regression uses."""
