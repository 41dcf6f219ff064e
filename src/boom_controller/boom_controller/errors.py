"""What a controller refuses; every error is one line that says what is wrong and what to do."""

from boom_model.errors import ModelError


class ControlError(ModelError):
    """Settings that cannot be used, or a machine that a control mode cannot be made for."""
