"""Del Prete and Mansard (2015): robustness of task-space inverse dynamics to torque errors."""
