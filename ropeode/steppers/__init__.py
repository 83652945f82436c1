"""One-step methods: those of ropeode by name, and whatever else advances a state by dt."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
