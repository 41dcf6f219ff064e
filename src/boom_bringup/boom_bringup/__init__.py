"""Launch files, parameter files, the URDF and the commands of the boom."""

__version__ = "0.1.0"
