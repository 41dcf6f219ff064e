"""The stand-in for the crane: the simulated boom with its sensors on ROS topics."""
