"""Benchmarks that print rows: `python -m tests.benchmarks` lists them. They are not installed."""
