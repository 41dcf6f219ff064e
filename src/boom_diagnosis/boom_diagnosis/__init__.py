"""Validation of the model against recordings, and the reports."""

__version__ = "0.2.0"
