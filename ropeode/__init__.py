"""ODE steppers checked against certified reference solutions.

The public names are listed in `__init__.pyi`, where editors and type checkers read them. Each
is imported when it is first used, so that `import ropeode` is quick and does not import JAX.
"""

from __future__ import annotations

from typing import Any

import lazy_loader

from ropeode import rooms_above

_public_name, _public_names, __all__ = lazy_loader.attach_stub(__name__, __file__)


def _render() -> Any:
    from ropeode import render

    return render


def _references() -> Any:
    from ropeode import references

    return references


rooms_above.render, rooms_above.references = _render, _references


def __dir__() -> list[str]:
    return [*_public_names(), "__version__"]


def __getattr__(name: str) -> Any:
    if name == "__version__":
        from importlib import metadata

        return metadata.version(__name__)
    return _public_name(name)
