"""What a person reads: plots, block graphs, the HTML report."""
