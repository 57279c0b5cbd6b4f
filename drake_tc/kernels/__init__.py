"""Compiled functions on arrays: what a control loop repeats every tick, free of the cost of single NumPy calls."""
