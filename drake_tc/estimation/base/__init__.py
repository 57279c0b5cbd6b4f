"""The floating base's pose and velocity, from the point of each contact that stands still (EQUATIONS C3)."""
