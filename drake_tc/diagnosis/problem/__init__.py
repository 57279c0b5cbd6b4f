"""Columns, bounds and folds of a regression: of one joint, of joints that share causes, of an arm."""
