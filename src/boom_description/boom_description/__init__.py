"""Geometry of the machine for other programs: URDF, pose of the boom tip."""
