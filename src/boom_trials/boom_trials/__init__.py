"""Trials of the product: the diagnosis on concealed machines, the controller on off-nominal machines."""

__version__ = "0.2.0"
