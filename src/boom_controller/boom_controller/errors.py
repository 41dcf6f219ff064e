"""Errors of the controller; each is one line that says what is wrong and what to do."""

from boom_model.errors import ModelError


class ControlError(ModelError):
    """Impossible settings, or a machine for which a control mode cannot be created."""
