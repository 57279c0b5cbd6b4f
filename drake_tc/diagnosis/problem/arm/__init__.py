"""Several joints as one regression with the links' inertial parameters."""
