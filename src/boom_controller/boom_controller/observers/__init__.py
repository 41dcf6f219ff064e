"""What control laws estimate: load, compliance and missing flow, a supply that does not deliver."""
