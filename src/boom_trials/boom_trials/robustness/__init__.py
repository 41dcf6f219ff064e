"""The controller on machines, loads and supplies off their numbers: ch. 6.5 and beyond."""
