"""Stability of sampled torque loops: linearisation, margins, one joint in closed form, limit cycles."""
