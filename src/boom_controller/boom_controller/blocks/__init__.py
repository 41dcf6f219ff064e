"""What control laws are made of: model, valve, feedback, and the one function that a cycle calls."""
