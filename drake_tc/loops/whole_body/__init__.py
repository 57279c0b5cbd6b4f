"""The parts of the diagrams around robust TSID: scenario, references, ground, drives, torque errors."""
