"""Reference trajectories and their certificates. Knows nothing of steppers."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
