"""The problems that come with the package, by name."""

from __future__ import annotations

from collections.abc import Callable

from ropeode.problems.chaos import double_pendulum, henon_heiles, lorenz
from ropeode.problems.forced import forced
from ropeode.problems.inextensible_rope import InextensibleRope
from ropeode.problems.kepler import kepler
from ropeode.problems.linear_chain import linear_chain
from ropeode.problems.orbits import arenstorf, pleiades
from ropeode.problems.oscillator import oscillator
from ropeode.problems.pendulum import pendulum
from ropeode.problems.problem import Problem
from ropeode.problems.rope import Rope
from ropeode.problems.stiff import hires, oregonator, robertson, van_der_pol

# The ropes, which take the same words in specs and options.
ROPES: dict[str, type[Rope] | type[InextensibleRope]] = {
    rope.kind: rope for rope in (Rope, InextensibleRope)
}

# Each problem's `parameters` name its kind, one of these keys; with the others it is built anew.
PROBLEMS: dict[str, Callable[..., Problem]] = {
    **{name: rope.from_parameters for name, rope in ROPES.items()},
    "oscillator": oscillator,
    "linear-chain": linear_chain,
    "kepler": kepler,
    "forced": forced,
    "pendulum": pendulum,
    "double-pendulum": double_pendulum,
    "henon-heiles": henon_heiles,
    "arenstorf": arenstorf,
    "pleiades": pleiades,
    "van-der-pol": van_der_pol,
    "lorenz": lorenz,
    "robertson": robertson,
    "hires": hires,
    "oregonator": oregonator,
}


def rope_of(problem: Problem) -> type[Rope] | type[InextensibleRope] | None:
    """The ropes that a problem is one of, by its parameters; None if it is no rope.

    Parameters are what their maker, or a file, says that they are.
    """
    kind = problem.parameters.get("kind")
    rope = ROPES.get(kind) if isinstance(kind, str) else None
    return rope if rope and rope.model_fields.keys() <= problem.parameters.keys() else None
