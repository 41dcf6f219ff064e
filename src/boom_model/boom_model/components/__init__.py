"""The components of a boom: one file, one equation of the thesis each. Every file here is found and registers itself."""

from importlib import import_module
from pkgutil import iter_modules

for _module in iter_modules(__path__):
    import_module(f"{__name__}.{_module.name}")
