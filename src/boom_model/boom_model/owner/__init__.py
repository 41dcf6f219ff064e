"""A machine file for a new crane, from what a data sheet, a URDF and a tape measure can answer."""
