"""Sensor models: what encoders, IMUs and force/torque sensors make of the truth."""
