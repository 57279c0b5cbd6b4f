"""The harder draw: simulated single joints that test what the diagnosis names, written without it."""
