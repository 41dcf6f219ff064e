"""What is watched, every reason to stop, and how a stop goes."""
