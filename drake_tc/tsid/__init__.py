"""Task-space inverse dynamics that stays feasible when the torques err: tasks, limits, contacts, programs, solvers."""
