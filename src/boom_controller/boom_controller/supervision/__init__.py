"""Monitoring, reasons to stop, and the course of a stop."""
