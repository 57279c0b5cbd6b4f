"""What the final model leaves, held against the noise floor."""
