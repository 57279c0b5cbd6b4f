"""Robot and actuator models: data only."""
