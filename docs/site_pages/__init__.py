"""Pages of the documentation site that are generated when it is built: one module for each kind of page."""
