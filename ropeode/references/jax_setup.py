"""JAX in a process of ropeode's own: a command, or a worker."""

from __future__ import annotations

import os
import warnings

import jax
import platformdirs

from ropeode import cache_folder


def set_up_jax() -> None:
    """Use 64-bit types, and keep what was traced, compiled and solved in the user's cache folder.

    To be called before anything is solved.
    """
    jax.config.update("jax_enable_x64", True)
    keep_programs()


def keep_programs() -> None:
    """Keep what is traced, compiled and solved in the user's cache folder."""
    # Equinox's checks at run time call back into Python, and a program that does so cannot be
    # kept. Of diffrax's there are two, that sample times increase and lie in the span; both
    # are checked where a problem is built. Equinox reads this when it is imported.
    os.environ.setdefault("EQX_ON_ERROR", "off")
    cache = platformdirs.user_cache_path("ropeode")
    cache_folder.keep_in(cache)
    jax.config.update("jax_compilation_cache_dir", str(cache / "compiled"))
    jax.config.update("jax_persistent_cache_min_compile_time_secs", 0.0)
    jax.config.update("jax_persistent_cache_min_entry_size_bytes", -1)
    # On a full disk, which the result does not need.
    warnings.filterwarnings("ignore", "Error (reading|writing) persistent compilation cache")
