"""The ropes of the library, which take the same words in specs and options."""

from __future__ import annotations

from ropeode.problems.inextensible_rope import InextensibleRope
from ropeode.problems.rope import Rope

ROPES: dict[str, type[Rope] | type[InextensibleRope]] = {
    rope.kind: rope for rope in (Rope, InextensibleRope)
}
