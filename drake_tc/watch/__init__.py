"""The same joint later: what changed since its model was made, its history, and a monitor in the loop."""
