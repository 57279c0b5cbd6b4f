"""How far the parameters of an identified model may be randomised, and files in which simulators draw them."""
