"""What the receivers of current commands promise."""

LONGEST_SILENCE_S = 0.1
"""s without a good command after which the valve is closed, whoever receives: bridge, ECU or simulation."""
CLOSED_A = 0.05
"""A. At as much every valve is shut: a zero with the noise of measured currents."""
