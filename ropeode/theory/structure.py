"""Which properties of the exact solution a step has, each with the order of its defect."""

from __future__ import annotations

import contextlib
import dataclasses
import functools
from collections.abc import Callable, Mapping, Sequence
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

from ropeode import cache
from ropeode.precision import in_float64
from ropeode.problems import Problem, compiled, free_coordinates
from ropeode.simulation import Method, method_of
from ropeode.theory.sample_map import NoSampleMap, SampleMap
from ropeode.theory.spectrum import spectrum_of

# The longest step, in turns of the fastest mode over 2 pi, and how often it is halved.
_LONGEST, _HALVINGS = 1.5, 8
_STATES = 2
# How far the exact solution is followed, in turns of the fastest mode over 2 pi; and what rounding
# leaves of a change that is none, of right-hand sides in JAX and in Python, whose derivatives are
# differences.
_SHORT = 2.0**-8
_ROUNDING, _IN_PYTHON = 1e-9, 1e-6
# How far nodes are moved from where they start, as a part of the problem's size.
_AWAY = 0.05
# What rounding leaves of no defect: of values, and of derivatives, exact and by differences.
_VALUES, _EXACT, _DIFFERENCES = 1e-13, 1e-12, 1e-9
# Smaller defects may be what an iterative step leaves of its equations.
_TOLERATED = 1e-6
# Defects are told from rounding by this factor; two slopes must be so near to a whole number.
_CLEAR, _WHOLE = 30.0, 0.2
# By which power of dt a defect goes at most that belongs to a method and not to its iteration.
_STEEPEST = 12
_MOMENTA = ("momentum", "angular momentum")
_OF_ENERGY = ("symplectic", "energy", *_MOMENTA)
# Why there is nothing to ask for, where the exact solution has not the property itself.
_LACKS = {
    "symplectic": "the problem is not Hamiltonian, so that no form is known to be preserved",
    "reversible": "the exact solution is not reversible",
    "volume": "the exact solution does not keep volume in phase space",
    "energy": "the problem does not keep its energy",
    **dict.fromkeys(_MOMENTA, "no component of it is known to be constant"),
}
_NO_MAP = (
    "what the step carries remembers more than the state shows, so that it is no map of states"
)


@dataclasses.dataclass(frozen=True)
class Property:
    """Whether a step has a property of the exact solution.

    Arguments:
        holds: whether it does to rounding; None where the question does not apply.
        defect: by how much it is missed in one step of size `dt`, relative; None as before.
        power: the defect goes as this power of dt, over the step sizes that were tried; None where
            it holds, or where no power is clear.
        dt: the largest step size that was tried.
        note: why the question does not apply, or of what else than the problem itself it is
            answered; empty if there is nothing to say.
    """

    holds: bool | None
    defect: float | None
    power: int | None
    dt: float
    note: str = ""


@in_float64
def structure_of(
    problem: Problem, stepper: Any, only: Sequence[str] | None = None
) -> dict[str, Property] | str:
    """Which properties of the exact solution one step has, at states without any symmetry.

    `symplectic`: the map keeps the form ``dx ^ dp``. `reversible`: a step, a reversal of velocities
    and another step lead back. `volume`: the map keeps volume in phase space. `energy`: it keeps
    the energy; `momentum`: what is constant of the sum of all momenta; `angular momentum`:
    likewise. (Hairer, Lubich, Wanner, Geometric Numerical Integration: sections VI.2, V.1, VI.9,
    and IV.1.)

    Damping is left out: the arguments named `damping` are set to 0. So are, for momenta, pins
    (`free`) and `gravity` where with them no momentum is constant.

    Arguments:
        problem: a mechanical one.
        stepper: whatever `ropeode.as_stepper` takes.
        only: names of properties; by default all.

    Returns:
        The properties by name; or why there is nothing to say.

    Raises:
        InputError: there is no such stepper, or it cannot run on the problem.
        UserCodeError: a user's step raised.
    """
    if problem.mechanics is None:
        return "the problem is not mechanical"
    if problem.rigid:
        return "the problem has rigid links, so that its motions fill a part of phase space only"
    method = method_of(stepper, problem)
    undamped = with_leaves(problem, {"damping": 0.0})
    damping = problem.mechanics.damping
    if damping is not None and np.any(np.asarray(damping(undamped.args).rate)):
        return "the problem has damping, and no argument of the name damping that takes it away"
    setting = Setting.of(undamped)
    if setting is None:
        return "nothing moves"
    return {name: _property(setting, method, name) for name in (_LACKS if only is None else only)}


@dataclasses.dataclass(frozen=True, eq=False)
class Setting:
    """Where steps are tried, and what they may miss there.

    With the energy ``E(x, v)`` the canonical momenta are ``p = dE/dv``. (Of ``T + V`` with a
    kinetic energy T quadratic in the velocities, these are those of the Lagrangian ``T - V``.)

    Arguments:
        problem: a mechanical one.
        states: ``(states, *state)``.
        dts: step sizes, the longest first.
        rate: of the fastest mode, per time unit.
        free: which components of a flat state can move.
    """

    problem: Problem
    states: np.ndarray
    dts: np.ndarray
    rate: float
    free: np.ndarray

    @classmethod
    def of(cls, problem: Problem) -> Setting | None:
        """States without any symmetry, near the start of a problem; None where nothing moves."""
        free = free_coordinates(problem)
        draw = np.random.default_rng(11).normal(size=(_STATES, *problem.y0.shape))
        draw[:, :, ~free] = 0.0
        at = np.full(_STATES, problem.ts[0])
        away = _AWAY * problem.scale * draw
        still = problem.y0 + np.array([1.0, 0.0]).reshape(2, *[1] * free.ndim) * away
        modes = spectrum_of(problem, at, still).eigenvalues
        rate = float(np.max(np.abs(modes), initial=0.0))
        if rate == 0.0:
            return None
        # A speed with which the fastest mode would swing about so far.
        states = problem.y0 + np.array([1.0, 0.3 * rate]).reshape(2, *[1] * free.ndim) * away
        dts = _LONGEST / rate * 0.5 ** np.arange(_HALVINGS + 1)
        return cls(problem, states, dts, rate, np.tile(free.ravel(), 2))

    @functools.cached_property
    def hamiltonian(self) -> bool:
        """Whether the exact solution keeps the energy, and with it the form ``dx ^ dp``."""
        return bool(np.all(self.kept("energy")) and np.all(self.kept("symplectic")))

    @functools.cached_property
    def _steady(self) -> bool:
        """Whether the equation does not depend on time."""
        rhs, args = compiled(self.problem.rhs), self.problem.args
        begin, end = self.problem.ts[0], self.problem.ts[-1]
        return all(np.array_equal(rhs(begin, y, args), rhs(end, y, args)) for y in self.states)

    @functools.cached_property
    def _exact(self) -> tuple[SampleMap, float]:
        """The exact solution, over a time so short that RK4 is exact to rounding."""
        short = _SHORT / self.rate
        method = method_of("rk4", self.problem)
        return SampleMap(self.problem, method, self.states[0], short), short

    def kept(self, name: str) -> np.ndarray:
        """Which components of a defect the exact solution has not, as far as is known."""
        return cache.kept(
            "property",
            cache.described(("kept", name, self.problem)),
            lambda: self._kept(name),
            np.ndarray.tobytes,
            lambda contents: np.frombuffer(contents, dtype=bool),
        )

    def _kept(self, name: str) -> np.ndarray:
        if not self._steady or (self.problem.energy is None and name in _OF_ENERGY):
            return np.zeros(1, dtype=bool)
        defects = [self.defect(name, y, *self._exact) for y in self.states]
        rounding = _IN_PYTHON if self.problem.in_python else _ROUNDING
        return np.all(np.abs(defects) <= rounding * _SHORT, axis=0)

    def defect(self, name: str, y: np.ndarray, step: SampleMap, dt: float) -> np.ndarray:
        """By how much a step misses a property, relative to what is kept, ``(components,)``."""
        if name == "symplectic":
            unit = np.repeat([1.0, self.rate], np.sum(self.free) // 2)
            slope, form = step.derivative(y, dt, self.free), self.form(y)
            moved = slope.T @ self.form(step(y, dt)) @ slope - form
            # In units of positions and velocities in which the fastest mode turns with radius 1.
            moved, form = (unit[:, None] * each * unit for each in (moved, form))
            return moved.ravel() / np.max(np.abs(form))
        if name == "volume":
            change = np.linalg.slogdet(step.derivative(y, dt, self.free))[1]
            if self.hamiltonian:
                # The determinant of the form is the square of that of the momenta.
                ends = [np.linalg.slogdet(self.form(each))[1] for each in (y, step(y, dt))]
                change += 0.5 * (ends[1] - ends[0])
            return np.expm1(change)[None]
        if name == "reversible":
            turn = np.array([1.0, -1.0]).reshape(2, *[1] * (y.ndim - 1))
            units = np.array([1.0, 1.0 / self.rate]).reshape(turn.shape)
            back = turn * step(turn * step(y, dt), dt)
            return (units * (back - y)).ravel() / np.max(np.abs(units * y))
        (before, size), (after, _) = (self._quantity(name, each) for each in (y, step(y, dt)))
        return (after - before) / size

    def _quantity(self, name: str, y: np.ndarray) -> tuple[np.ndarray, float]:
        """The energy or a momentum of a state, ``(components,)``, and the size of its parts."""
        energy, p = compiled(_with_momenta, self.problem.energy)(
            self.problem.ts[0], y, self.problem.args
        )
        if name == "energy":
            return np.array([energy]), float(abs(energy) + abs(np.sum(p * y[1])))
        x, p = (self.problem.quantity("position", each[None])[0] for each in (y, np.stack([p, p])))
        parts = p if name == "momentum" else _cross(x, p)
        return np.sum(parts, axis=0), float(np.max(np.sum(np.abs(parts), axis=0), initial=0.0))

    def form(self, y: np.ndarray) -> np.ndarray:
        """The form ``dx ^ dp`` in the coordinates that can move, ``(2 free, 2 free)``."""
        half, slopes = y.size // 2, compiled(_slopes_of_momenta, self.problem.energy)
        slopes = np.asarray(slopes(self.problem.ts[0], y, self.problem.args)).reshape(half, -1)
        in_x, in_v = slopes[:, :half], slopes[:, half:]
        form = np.block([[in_x - in_x.T, in_v], [-in_v.T, np.zeros((half, half))]])
        return form[np.ix_(self.free, self.free)]

    def property(
        self,
        defect: Callable[[np.ndarray, float], float],
        rounding: float,
        tried: tuple[int, int] = (_STATES, _HALVINGS + 1),
        note: str = "",
    ) -> Property:
        """A defect at so many of the states and step sizes, as a `Property`."""
        states, sizes = tried
        found, no_map = [], False
        with np.errstate(all="ignore"):
            for dt in self.dts[:sizes].tolist():
                try:
                    size = float(np.max([defect(y, dt) for y in self.states[:states]]))
                except NoSampleMap:
                    no_map = True
                    continue
                # An implicit step may fail where it is long.
                if np.isfinite(size):
                    found.append((dt, size))
                if size <= rounding:
                    break
        if not found:
            return self.missing(_NO_MAP if no_map else "no step was finite")
        dt, largest = found[0]
        if largest <= rounding and dt < self.dts[0]:
            return self.missing("longer steps, which would show a defect, were not finite")
        if largest <= rounding:
            return Property(True, largest, None, dt, note)
        if len(found) > 1 and found[-1][1] <= rounding < found[-2][1] * 0.5**_STEEPEST:
            # No order of a method makes a defect go away in half a step.
            why = f"steps of {dt:.3g} miss it by {largest:.1e}: an iteration ends too soon"
            return Property(True, found[-1][1], None, found[-1][0], why)
        clear = np.array([size for _, size in found if size > _CLEAR * rounding])
        power = _power(clear)
        if power is None and largest <= _TOLERATED and not _shrinks(clear):
            why = "it is missed by little, however short the steps: an iteration may end too soon"
            return Property(None, largest, None, dt, why)
        return Property(False, largest, power, dt, note)

    def missing(self, why: str) -> Property:
        """That the question does not apply."""
        return Property(None, None, None, float(self.dts[0]), why)


def _power(sizes: np.ndarray) -> int | None:
    """By which power of dt defects go that belong to halved step sizes; None if that is not clear.

    The slopes between neighbours go to that power as dt itself goes to 0, so that their
    extrapolation is nearer. It must stay the same.
    """
    slopes = np.log2(sizes[:-1] / sizes[1:])
    if len(slopes) < 3 or not np.all(np.isfinite(slopes)):
        return None
    limits = 2.0 * slopes[-2:] - slopes[-3:-1]
    power = round(limits[-1])
    near = np.max(np.abs(limits - power)) <= _WHOLE and abs(slopes[-1] - power) <= 2 * _WHOLE
    return power if near else None


def _shrinks(sizes: np.ndarray) -> bool:
    """Whether defects at halved step sizes go down at least in proportion to dt."""
    return len(sizes) > 1 and bool(sizes[-1] <= sizes[0] * 0.5 ** (len(sizes) - 1))


def _property(own: Setting, method: Method, name: str) -> Property:
    setting, kept, note = own, own.kept(name), ""
    if name in _MOMENTA and not np.any(kept):
        # Momenta are constant without pins and gravity, if not with them.
        loose = Setting.of(with_leaves(own.problem, {"gravity": 0.0, "free": 1.0}))
        if loose is not None:
            setting, kept, note = loose, loose.kept(name), "without pins and gravity"
    if own.problem.energy is None and name in _OF_ENERGY:
        return own.missing("the problem declares no energy")
    if not (np.any(kept) if name in _MOMENTA else np.all(kept)):
        return own.missing(_LACKS[name])
    step = _sample_map(setting, method)
    if step is None:
        return setting.missing(_NO_MAP)
    rounding, tried = _VALUES, (_STATES, _HALVINGS + 1)
    if name in ("symplectic", "volume"):
        # Differences take long.
        rounding, tried = (_EXACT, tried) if step.exact else (_DIFFERENCES, (1, 5))

    def defect(y: np.ndarray, dt: float) -> float:
        return float(np.max(np.abs(setting.defect(name, y, step, dt)[kept])))

    return setting.property(defect, rounding, tried, note)


@functools.lru_cache(maxsize=4)
def _sample_map(setting: Setting, method: Method) -> SampleMap | None:
    # An implicit step may fail where it is long.
    for dt in setting.dts.tolist():
        with contextlib.suppress(NoSampleMap), np.errstate(all="ignore"):
            found = SampleMap(setting.problem, method, setting.states[0], dt)
            # It shows here whether a sample can be turned back into what is carried.
            if np.all(np.isfinite(found(setting.states[0], dt))):
                return found
    return None


def with_leaves(problem: Problem, values: Mapping[str, float]) -> Problem:
    """A problem with the arguments of some names set to a number each.

    Arguments:
        problem: whose `args` are a named tuple, a dict or the like; others stay as they are.
        values: by the name of a field.
    """

    def changed(path: Any, leaf: Any) -> Any:
        last = path[-1] if path else None
        name = str(getattr(last, "name", getattr(last, "key", "")))
        return np.full_like(leaf, values[name]) if name in values else leaf

    args = jax.tree_util.tree_map_with_path(changed, problem.args)
    return problem.changed(args=args, exact=None)


def _cross(x: np.ndarray, p: np.ndarray) -> np.ndarray:
    """The angular momentum of each node; of none in one dimension."""
    if x.shape[-1] == 2:
        return (x[..., 0] * p[..., 1] - x[..., 1] * p[..., 0])[..., None]
    return np.cross(x, p) if x.shape[-1] == 3 else np.zeros((*x.shape[:-1], 0))


def _momenta(energy: Callable) -> Callable:
    def momenta(t: Any, y: Any, args: Any) -> Any:
        return jax.grad(lambda v: energy(t, jnp.stack([y[0], v]), args))(y[1])

    return momenta


def _with_momenta(energy: Callable) -> Callable:
    return lambda t, y, args: (energy(t, y, args), _momenta(energy)(t, y, args))


def _slopes_of_momenta(energy: Callable) -> Callable:
    return jax.jacfwd(_momenta(energy), argnums=1)
