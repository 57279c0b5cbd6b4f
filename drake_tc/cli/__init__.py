"""The `drake-tc` commands."""
