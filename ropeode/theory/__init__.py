"""A stepper as a map near dt = 0: what it solves, of which order, and where it is unstable."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
