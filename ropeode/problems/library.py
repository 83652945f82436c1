"""The problems that come with the package, by name."""

from __future__ import annotations

from collections.abc import Callable

from ropeode.problems.arenstorf import arenstorf
from ropeode.problems.double_pendulum import double_pendulum
from ropeode.problems.forced import forced
from ropeode.problems.henon_heiles import henon_heiles
from ropeode.problems.hires import hires
from ropeode.problems.kepler import kepler
from ropeode.problems.linear_chain import linear_chain
from ropeode.problems.lorenz import lorenz
from ropeode.problems.oregonator import oregonator
from ropeode.problems.oscillator import oscillator
from ropeode.problems.pendulum import pendulum
from ropeode.problems.pleiades import pleiades
from ropeode.problems.problem import Problem
from ropeode.problems.robertson import robertson
from ropeode.problems.ropes import ROPES
from ropeode.problems.van_der_pol import van_der_pol

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
