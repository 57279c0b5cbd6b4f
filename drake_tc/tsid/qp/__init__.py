"""Quadratic programs from matrices, and the solvers that take them."""
