"""ROS bags as logs: topics to canonical columns, joined on the clock of the joint states."""
