"""Benchmarks that print rows: the blind rigs, real data, speed."""
