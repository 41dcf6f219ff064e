"""Commands, launch files and parameter files of the boom."""

__version__ = "0.2.0"
