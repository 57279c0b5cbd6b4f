"""Drives and effects joined into actuator models, and the system that puts them before a plant."""
