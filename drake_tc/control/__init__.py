"""Torque control through a drive that was not made for it: gains, inverse dynamics, torque loop, safety."""
