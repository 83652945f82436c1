"""Arrays of numbers, checked where they enter."""

from __future__ import annotations

from typing import Any

import jax
import numpy as np

from ropeode.validation import bad_value, require_all_digits


def real_array(name: str, value: Any, example: str = "[1.0, 0.0]") -> np.ndarray:
    """`value` as a new float64 array of finite numbers.

    Arguments:
        name: of the value, for messages.
        value: to be checked.
        example: of one that can be used.

    Raises:
        InputError: it is empty, not real, or not finite.
    """
    allowed = "an array of finite real numbers"
    try:
        array = np.asarray(value)
    except (TypeError, ValueError):
        array = np.asarray(None)
    if array.dtype.kind not in "iuf" or array.size == 0:
        raise bad_value(name, value, allowed, f"give numbers, such as {example}")
    if np.ma.is_masked(value):
        raise bad_value(name, value, allowed, "fill the masked entries")
    entries = value if isinstance(value, (list, tuple)) else array
    for path, entry in jax.tree_util.tree_leaves_with_path(entries):
        # NumPy widens those of a list.
        float64_only(name + jax.tree_util.keystr(path), np.asarray(entry))
    array = np.array(array, dtype=np.float64)
    if not np.all(np.isfinite(array)):
        where = np.argwhere(~np.isfinite(array))[0].tolist()
        fix = f"correct entry {where}, which is not finite" if where else f"for example {example}"
        raise bad_value(name, value, allowed, fix)
    return array


def float64_only(name: str, array: np.ndarray) -> None:
    """Raises:
    InputError: a number in it has fewer digits than float64, and would be another one there.
    """
    try:
        require_all_digits(array)
    except ValueError:
        raise bad_value(
            name,
            array,
            "numbers in float64 (arrays of JAX are float32 outside of its float64 mode, and 0.1 is "
            "0.10000000149 there)",
            "make it in NumPy or Python, as in np.array([0.1])",
        ) from None
