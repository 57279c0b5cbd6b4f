"""Leg logs with an undeclared effect, for the blind benchmark of whole robots."""
