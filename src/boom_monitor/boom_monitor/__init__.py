"""Watches a running machine: turns samples into an alarm that names the subsystem."""
