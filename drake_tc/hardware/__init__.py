"""A controller without a plant against a robot: stepped tick by tick, and against wall-clock time."""
