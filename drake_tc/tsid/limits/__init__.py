"""What the robot must not do: each limit is named rows of inequalities over accelerations, forces and torques."""
