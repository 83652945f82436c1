"""Initial value problems: what is solved.

The names that others use are listed in `__init__.pyi`. Each is imported when it is first used: the
command line reads the options of a rope without JAX.
"""

from __future__ import annotations

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
