"""Observers of the control laws: load, compliance and missing flow, insufficient supply."""
