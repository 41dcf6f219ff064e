"""python-can and cantools, without what they load beside a CAN bus.

Where asammdf is installed (`./boom import` reads MF4 with it), python-can loads it for a logger that nothing here uses, and with it
pandas: 1.3 s and 60 MB for every process of the chain. While they are imported it is hidden.
"""

import sys

__all__ = ["can", "cantools"]

_HIDDEN = "asammdf"

_hides = _HIDDEN not in sys.modules
if _hides:
    sys.modules[_HIDDEN] = None  # type: ignore[assignment]
try:
    import can
    import cantools
finally:
    if _hides:
        del sys.modules[_HIDDEN]
