"""Robust task-space inverse dynamics: what a tick computes (`drake_tc.tsid`)."""
