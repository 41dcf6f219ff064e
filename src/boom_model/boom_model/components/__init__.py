"""The components of a boom: one file, one equation of the thesis each."""
