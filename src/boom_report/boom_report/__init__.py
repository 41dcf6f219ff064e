"""HTML reports and tables on a terminal."""

__version__ = "0.1.0"
