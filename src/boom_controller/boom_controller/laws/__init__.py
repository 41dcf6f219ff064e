"""The control laws: a file each, found by itself."""
