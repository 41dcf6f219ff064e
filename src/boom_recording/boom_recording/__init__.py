"""Bags to one table of signals and back; the recorder and the replay node."""
