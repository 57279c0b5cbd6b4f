"""Log files of each format as tables."""
