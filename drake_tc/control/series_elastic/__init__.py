"""Torque control of voltage-driven series-elastic joints: inverse motor model, friction observer, baselines."""
