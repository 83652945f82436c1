"""Published experiments run again, claim by claim.

What other rooms may use is listed in `__init__.pyi`, and imported when it is first used.
"""

from __future__ import annotations

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
