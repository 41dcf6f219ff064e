"""Where the boom shall be, over time."""
