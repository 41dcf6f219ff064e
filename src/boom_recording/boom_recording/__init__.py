"""Reads bags into one table of signals and writes them; the recorder and the replay node."""
