"""Joint torques, wrenches and faults, from the sensors that a position-controlled robot has."""
