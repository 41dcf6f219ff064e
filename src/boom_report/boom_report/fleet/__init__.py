"""The page of a fleet: at a glance, what to look at, each machine over time."""
