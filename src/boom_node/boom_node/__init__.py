"""The thin common shell of the boom's ROS nodes: start, stop, parameters, diagnostics, QoS."""
