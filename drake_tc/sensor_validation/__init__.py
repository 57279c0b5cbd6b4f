"""Sensors checked before they are used, and what stands in for those that fail."""
