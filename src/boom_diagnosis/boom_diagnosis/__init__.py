"""Validation of the model against recordings, and the reports."""
