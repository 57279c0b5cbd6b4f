"""From a residual to the physical effect that the model lacks."""
