"""What a log is refused for, and what is mended in it: its clock, its values and its signs."""
