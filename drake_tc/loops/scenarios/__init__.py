"""What happens in a diagram, as data: scenarios, references, faults of sensors and surroundings."""
