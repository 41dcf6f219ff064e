"""Chapter 5 on a page."""
