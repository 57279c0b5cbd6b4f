"""What the robot should do: each task is rows of a least-squares cost over accelerations or contact forces."""
