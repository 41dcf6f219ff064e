"""The thin common base of the boom's ROS nodes: start, stop, parameters, diagnostics, QoS."""
