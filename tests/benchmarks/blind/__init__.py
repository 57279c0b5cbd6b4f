"""The blind benchmark: rigs simulated apart from the effect library, their truth, and the score of a diagnosis."""
