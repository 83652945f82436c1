"""Which properties of the exact solution a step has, each with the order of its defect."""

from __future__ import annotations

import contextlib
import dataclasses
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from ropeode.precision import in_float64
from ropeode.problems import Problem, free_coordinates
from ropeode.simulation import Method, method_of
from ropeode.theory.conserved import Conserved, scales, with_leaves
from ropeode.theory.sample_map import NoSampleMap, SampleMap
from ropeode.theory.spectrum import spectrum_of

# The longest step, in turns of the fastest mode over 2 pi, and how often it is halved.
_LONGEST, _HALVINGS = 1.5, 8
_STATES = 2
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
    step = _sample_map(setting, method)
    slopes = _Slopes(step, setting.flow.free)
    found: dict[str, Callable[[], Property]] = {
        "symplectic": lambda: _symplectic(setting, step, slopes),
        "reversible": lambda: _reversible(setting, step),
        "volume": lambda: _volume(setting, step, slopes),
        "energy": lambda: _energy(setting, step),
        "momentum": lambda: _momentum(setting, method, "linear"),
        "angular momentum": lambda: _momentum(setting, method, "angular"),
    }
    return {name: found[name]() for name in (found if only is None else only)}


@dataclasses.dataclass(frozen=True, eq=False)
class Setting:
    """Where steps are tried: a problem, states of it, and step sizes."""

    problem: Problem
    states: np.ndarray
    dts: np.ndarray
    rate: float
    flow: Conserved

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
        return cls(problem, states, dts, rate, Conserved(problem, states, free, rate))

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


class _Slopes:
    """The derivatives of a map, each computed once."""

    def __init__(self, step: SampleMap | None, free: np.ndarray):
        self._step, self._free = step, free
        self._found: dict[tuple[bytes, float], np.ndarray] = {}

    def __call__(self, y: np.ndarray, dt: float) -> np.ndarray:
        """At a state, ``(free components, free components)``."""
        assert self._step is not None
        key = y.tobytes(), dt
        if key not in self._found:
            self._found[key] = self._step.derivative(y, dt, self._free)
        return self._found[key]


def _sample_map(setting: Setting, method: Method) -> SampleMap | None:
    # An implicit step may fail where it is long.
    for dt in setting.dts.tolist():
        with contextlib.suppress(NoSampleMap), np.errstate(all="ignore"):
            found = SampleMap(setting.problem, method, setting.states[0], dt)
            # It shows here whether a sample can be turned back into what is carried.
            if np.all(np.isfinite(found(setting.states[0], dt))):
                return found
    return None


def _symplectic(setting: Setting, step: SampleMap | None, slopes: _Slopes) -> Property:
    flow = setting.flow
    if not flow.hamiltonian:
        why = "declares no energy" if flow.energy is None else "is not Hamiltonian"
        return setting.missing(f"the problem {why}, so that no form is known to be preserved")
    if step is None:
        return setting.missing(_NO_MAP)

    def defect(y: np.ndarray, dt: float) -> float:
        scale = scales(int(np.sum(flow.free)), setting.rate)
        derivative = slopes(y, dt)
        before, after = flow.form(y), flow.form(step(y, dt))
        off = scale[:, None] * (derivative.T @ after @ derivative - before) * scale
        return float(np.max(np.abs(off)) / np.max(np.abs(scale[:, None] * before * scale)))

    return setting.property(defect, *_of_derivatives(step))


def _volume(setting: Setting, step: SampleMap | None, slopes: _Slopes) -> Property:
    flow = setting.flow
    if not flow.volume:
        return setting.missing("the exact solution does not keep volume in phase space")
    if step is None:
        return setting.missing(_NO_MAP)

    def defect(y: np.ndarray, dt: float) -> float:
        change = np.linalg.slogdet(slopes(y, dt))[1]
        if flow.hamiltonian:
            # The determinant of the form is the square of that of the momenta.
            ends = [np.linalg.slogdet(flow.form(each))[1] for each in (y, step(y, dt))]
            change += 0.5 * (ends[1] - ends[0])
        return float(abs(np.expm1(change)))

    return setting.property(defect, *_of_derivatives(step))


def _reversible(setting: Setting, step: SampleMap | None) -> Property:
    if not setting.flow.reversible:
        return setting.missing("the exact solution is not reversible")
    if step is None:
        return setting.missing(_NO_MAP)
    turn = np.array([1.0, -1.0]).reshape(2, *[1] * (setting.problem.y0.ndim - 1))
    units = np.array([1.0, 1.0 / setting.rate]).reshape(turn.shape)

    def defect(y: np.ndarray, dt: float) -> float:
        back = turn * step(turn * step(y, dt), dt)
        return float(np.max(np.abs(units * (back - y))) / np.max(np.abs(units * y)))

    return setting.property(defect, _VALUES)


def _energy(setting: Setting, step: SampleMap | None) -> Property:
    flow = setting.flow
    if not flow.energy:
        why = "declares no energy" if flow.energy is None else "does not keep its energy"
        return setting.missing(f"the problem {why}")
    if step is None:
        return setting.missing(_NO_MAP)

    def defect(y: np.ndarray, dt: float) -> float:
        before, size = flow.energies(y)
        return abs(flow.energies(step(y, dt))[0] - before) / size

    return setting.property(defect, _VALUES)


def _momentum(own: Setting, method: Method, which: str) -> Property:
    setting, note = own, ""
    if not np.any(getattr(own.flow, which)):
        # Momenta are constant without pins and gravity, if not with them.
        loose = Setting.of(with_leaves(own.problem, {"gravity": 0.0, "free": 1.0}))
        if loose is None or not np.any(getattr(loose.flow, which)):
            return own.missing("no component of it is known to be constant")
        setting, note = loose, "without pins and gravity"
    step = _sample_map(setting, method)
    if step is None:
        return setting.missing(_NO_MAP)
    constant = getattr(setting.flow, which)
    momenta = setting.flow.momenta if which == "linear" else setting.flow.angular_momenta

    def defect(y: np.ndarray, dt: float) -> float:
        (before, size), (after, _) = momenta(y), momenta(step(y, dt))
        return float(np.max(np.abs(after - before)[constant]) / np.max(size))

    return setting.property(defect, _VALUES, note=note)


def _of_derivatives(step: SampleMap) -> tuple[float, tuple[int, int]]:
    """What rounding leaves, and how many states and step sizes to try: differences take long."""
    return (_EXACT, (_STATES, _HALVINGS + 1)) if step.exact else (_DIFFERENCES, (1, 5))
