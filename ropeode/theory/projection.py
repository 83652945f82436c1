"""A vector field as a sum of known ones, and what is left over."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

# A field counts as independent if so much of it is left when those before it are taken off.
_INDEPENDENT = 1e-9


class Projection(NamedTuple):
    """Coefficients of known fields.

    Fields:
        coefficients: ``(fields,)``; 0 for those that the ones before contain.
        rest: the largest component that is left over.
        spread: how far each coefficient is off at most, if no error of the target is larger than
            what is left over, ``(fields,)``.
    """

    coefficients: np.ndarray
    rest: float
    spread: np.ndarray


def projected(target: np.ndarray, fields: np.ndarray) -> Projection:
    """The sum of known fields that comes closest to a field, by least squares.

    Arguments:
        target: at several states, ``(components,)``.
        fields: ``(fields, components)``; of those that depend on each other the first are used.
    """
    coefficients, gain = np.zeros(len(fields)), np.zeros(len(fields))
    size = np.linalg.norm(fields, axis=1)
    used = np.flatnonzero(size > 0.0)
    if len(used):
        units = (fields[used] / size[used, None]).T
        # What a column adds to those before it stands on the diagonal.
        diagonal = np.abs(np.diag(np.linalg.qr(units, mode="r")))
        # Where there are more columns than rows, the last add nothing.
        added = np.pad(diagonal, (0, len(used) - len(diagonal)))
        used, units = used[added > _INDEPENDENT], units[:, added > _INDEPENDENT]
        coefficients[used] = np.linalg.lstsq(units, target)[0] / size[used]
        inverse = np.linalg.inv(np.linalg.qr(units, mode="r"))
        gain[used] = np.linalg.norm(inverse, axis=1) / size[used]
    rest = float(np.max(np.abs(target - coefficients @ fields), initial=0.0))
    return Projection(coefficients, rest, gain * rest * np.sqrt(len(target)))
