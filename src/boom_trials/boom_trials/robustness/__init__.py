"""The controller on off-nominal machines, loads and supplies: ch. 6.5 and beyond."""
