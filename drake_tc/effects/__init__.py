"""One physical effect, one object: equation, dynamics, compensation and signature."""
