"""Methods as their coefficients: tableaus, and their order by conditions on rooted trees."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
