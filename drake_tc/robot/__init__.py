"""A robot as data: URDF and one YAML file become plants, joint order, limits and sensor frames."""
