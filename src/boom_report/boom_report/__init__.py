"""HTML reports and tables on a terminal."""

__version__ = "0.2.0"
