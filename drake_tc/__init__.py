"""Torque control of position-controlled robots in Drake, with a model held against measured data."""

__version__ = "0.1.0"
