"""The solvers of references, as values."""

from __future__ import annotations

import dataclasses

from ropeode.json_form import json_as


@json_as(str, str)
@dataclasses.dataclass(frozen=True)
class Solver:
    """A solver; `str` gives its name in tables and files.

    Arguments:
        library: that has it.
        method: its name there.
        bits: of its significands; None for float64.
    """

    library: str
    method: str
    bits: int | None = None

    def __str__(self) -> str:
        name = f"{self.library} {self.method}"
        return name if self.bits is None else f"{name}, {self.bits} bits"

    @classmethod
    def parse(cls, text: str) -> Solver:
        """The solver that a file names; the inverse of ``str(solver)``."""
        name, _, bits = text.partition(", ")
        library, _, method = name.partition(" ")
        return cls(library, method, int(bits.removesuffix(" bits")) if bits else None)

    @property
    def runs_in_diffrax(self) -> bool:
        """Whether one program of diffrax is its whole run."""
        return self.library == "diffrax" or self == RADAU9

    @property
    def implicit(self) -> bool:
        """Whether it solves equations in each step, and needs a derivative for that."""
        return self in (RADAU9, SCIPY_RADAU, SCIPY_BDF)


DOPRI8 = Solver("diffrax", "Dopri8")
SCIPY_DOP853 = Solver("SciPy", "DOP853")
SCIPY_RADAU = Solver("SciPy", "Radau")
SCIPY_BDF = Solver("SciPy", "BDF")
# Implicit solvers factor dense matrices up to so many unknowns, and sparse ones above.
MOST_DENSE = 300
# Many problems side by side; see `ropeode.references.solvers.dop853`.
# In the loop of diffrax; see `ropeode.references.solvers.radau`.
RADAU9 = Solver("ropeode", "Radau9")
OWN_DOP853 = Solver("ropeode", "DOP853")


def taylor(bits: int) -> Solver:
    """The Taylor series method of heyoka, with significands of so many bits."""
    return Solver("heyoka", "Taylor", bits)
