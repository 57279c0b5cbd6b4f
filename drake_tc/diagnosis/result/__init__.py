"""What `close-loop` found, as data, and as report.json."""
