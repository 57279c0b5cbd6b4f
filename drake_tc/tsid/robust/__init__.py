"""How probable it is that the limits hold although the torques err, and the torques that make it more so."""
