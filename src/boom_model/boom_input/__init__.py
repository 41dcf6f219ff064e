"""Files: what somebody else wrote, read within limits, and what we write, whole or not at all. Knows no other package."""
