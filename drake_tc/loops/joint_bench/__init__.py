"""One joint on a bench: its diagram, and its model driven by a recorded command alone."""
