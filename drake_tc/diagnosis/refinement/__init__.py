"""Output error: the model that was found, refined on the free runs of the training runs."""
