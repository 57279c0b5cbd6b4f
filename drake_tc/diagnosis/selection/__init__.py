"""Which effects are missing: screening, refinement, comparison, and when to stop."""
