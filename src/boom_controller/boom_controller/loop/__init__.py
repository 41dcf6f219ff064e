"""Sensors, reference, control law and supervision together, without ROS."""
