"""Torque control as one C99 file and its header: `to_c`."""
