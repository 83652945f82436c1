"""The lab: motion and true error side by side, in a browser, a notebook or a single file.

Python computes every number; the page draws. The page asks, and each answer depends on its question
alone, so answers can be kept, shipped in a file and asked for again.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
