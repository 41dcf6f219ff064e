"""The parts of the ROS shell."""
