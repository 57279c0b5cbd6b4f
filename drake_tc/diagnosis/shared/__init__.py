"""Causes that no single joint owns: a link's mass, an F/T or IMU error, judged on all joints together."""
