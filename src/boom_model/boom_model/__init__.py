"""The physics of the crane boom: components, full and reduced model, integration; no ROS."""
