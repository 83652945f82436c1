"""The ropes of the library, which take the same words in specs and options."""

from __future__ import annotations

from ropeode.problems.inextensible_rope import InextensibleRope
from ropeode.problems.problem import Problem
from ropeode.problems.rope import Rope

ROPES: dict[str, type[Rope] | type[InextensibleRope]] = {
    rope.kind: rope for rope in (Rope, InextensibleRope)
}


def rope_of(problem: Problem) -> type[Rope] | type[InextensibleRope] | None:
    """The ropes that a problem is one of, by its parameters; None if it is no rope.

    Parameters are what their maker, or a file, says that they are.
    """
    kind = problem.parameters.get("kind")
    rope = ROPES.get(kind) if isinstance(kind, str) else None
    return rope if rope and rope.model_fields.keys() <= problem.parameters.keys() else None
