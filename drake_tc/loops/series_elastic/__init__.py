"""One series-elastic joint: its scenario, its surroundings, its runs."""
