"""Running a scenario: the simulation, what it records, its summary, its cost and its faults."""
