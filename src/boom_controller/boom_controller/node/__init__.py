"""The parts of the ROS node."""
