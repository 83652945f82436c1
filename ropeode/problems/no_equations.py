"""Problems without their equations: those whose references were read from files."""

from __future__ import annotations

import dataclasses
from typing import Any, NoReturn

from ropeode.validation import bad_value


@dataclasses.dataclass(frozen=True)
class NoEquations:
    """In place of the functions of a problem, of which a file holds numbers only.

    Arguments:
        name: of the problem.
        path: of the file.
    """

    name: str
    path: str

    def __call__(self, *given: Any) -> NoReturn:
        """Raises:
        InputError: says where the equations can come from.
        """
        del given
        raise bad_value(
            "problem",
            self.name,
            f"a problem with equations here; {self.path!r} holds numbers only, of a problem that "
            "is not one of the library",
            "pass the problem, as in load_reference(path, problem) or --problem FILE.py:NAME",
        )

    # The pytree that such a state is made of is not known either.
    unravel = __call__
