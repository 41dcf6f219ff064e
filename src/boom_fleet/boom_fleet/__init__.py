"""Long recordings and fleets: screens many recordings of many machines, compares each machine with its own past."""

__version__ = "0.2.0"
