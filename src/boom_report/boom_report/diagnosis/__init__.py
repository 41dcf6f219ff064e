"""A diagnosis on a page and on a terminal."""
