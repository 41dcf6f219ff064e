"""The machine's geometry for others: URDF, pose of the boom tip."""
