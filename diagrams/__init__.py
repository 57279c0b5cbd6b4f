"""Complete, runnable diagrams: one file each."""
