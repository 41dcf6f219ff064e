"""Trials of the product: the diagnosis on concealed machines, the controller on machines off their numbers."""

__version__ = "0.1.0"
