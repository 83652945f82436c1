"""Packages that not every user needs, and that are installed with an extra."""

from __future__ import annotations

import importlib

from ropeode.errors import InputError


def require(package: str, extra: str) -> None:
    """See whether a package can be imported, before anything is computed.

    Arguments:
        package: its name in `import`.
        extra: of ropeode, that installs it.

    Raises:
        InputError: it cannot.
    """
    try:
        importlib.import_module(package)
    except ImportError as error:
        raise InputError(
            f"{package}: it cannot be imported ({error}); allowed: pictures with the extra "
            f"{extra!r} only. Fix: pip install 'ropeode[{extra}]'"
        ) from None
