"""The acceleration of gravity."""

GRAVITY = 9.81
"""Drake's own [m/s^2]."""
