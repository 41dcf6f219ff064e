"""The simulated crane: the boom with its sensors on ROS topics."""
