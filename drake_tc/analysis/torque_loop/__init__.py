"""The torque loop as the analysis takes it: linear loops, an operating point, tuned and perturbed copies."""
