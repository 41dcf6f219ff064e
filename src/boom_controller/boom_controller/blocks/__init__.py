"""Building blocks of control laws: model, valve, feedback, and the one function that a cycle calls."""
