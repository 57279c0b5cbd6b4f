"""Identification of geared joints from logs: excitation, regressions and their confidence intervals."""
