"""Files of other simulators (URDF, MJCF, BAM) as terms of actuators: what their users already model."""
