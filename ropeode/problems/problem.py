"""An initial value problem, written in JAX."""

from __future__ import annotations

import copy
import dataclasses
import inspect
import types
from collections.abc import Callable, Mapping, Sequence
from typing import TYPE_CHECKING, Any

import jax.numpy as jnp
import numpy as np
from numpy.typing import ArrayLike

from ropeode.arrays import real_array
from ropeode.display import Displayed
from ropeode.errors import InputError
from ropeode.json_form import json_shows
from ropeode.precision import in_float64, rhs_in_float64
from ropeode.problems import checks
from ropeode.problems.functions import compiled, for_each_state
from ropeode.problems.links import LinearDamping, Links
from ropeode.problems.no_equations import NoEquations
from ropeode.problems.python_rhs import PythonRhs
from ropeode.problems.scipy_form import ScipyFunction, scipy_form
from ropeode.problems.signatures import refuse_others
from ropeode.problems.state_structure import StateStructure, is_tree
from ropeode.validation import bad_value, check_all, check_memory, not_traced

Rhs = Callable[[Any, Any, Any], Any]
Acceleration = Callable[[Any, Any, Any, Any], Any]

# Fields that JAX could trace.
_NUMBERS = ("y0", "ts", "args", "jump_times")
# Fields that the other constructors hand on.
_MORE = ("name", "energy", "exact", "jump_times", "constraints", "parameters")


@dataclasses.dataclass(frozen=True)
class Mechanics:
    """What a second-order problem ``x'' = a(t, x, v)`` has beyond its first-order form.

    Arguments:
        acceleration: ``acceleration(t, x, v, args)`` in JAX, all forces included.
        damping: ``damping(args)`` gives the `LinearDamping` that `acceleration` contains;
            None where the acceleration depends on the velocity in another way.
        node_axis: the axis of the positions that counts nodes; the other counts the
            components.
        links: ``links(args)`` gives the `Links` between neighbours, for steppers that move nodes
            link by link; None where nodes do not stand in a row.
        in_turn: whether all of these also take several ropes whose nodes stand in turn, as
            `Links` explains; ensembles are faster that way.
        neighbours: whether the acceleration of each node depends on its own position and velocity
            and on those of its two neighbours in the row alone; implicit steppers then do O(nodes)
            work.
    """

    acceleration: Acceleration
    damping: Callable[[Any], LinearDamping] | None
    node_axis: int = 0
    links: Callable[[Any], Links] | None = None
    in_turn: bool = False
    neighbours: bool = False


@dataclasses.dataclass(frozen=True)
class FirstOrderForm:
    """The right-hand side ``(x, v)' = (v, a)`` of a second-order problem.

    Equal accelerations make equal (and equally hashed) forms, so that what was compiled
    for one rope serves the next.
    """

    acceleration: Acceleration

    def __call__(self, t: Any, y: Any, args: Any) -> Any:
        """The derivative of ``y = stack([x, v])``, of the same shape."""
        return rhs_in_float64(self._derivative, t, y, args)

    def _derivative(self, t: Any, y: Any, args: Any) -> Any:
        return jnp.stack([y[1], self.acceleration(t, y[0], y[1], args)])


@dataclasses.dataclass(frozen=True)
class FirstOrderRhs:
    """A right-hand side ``rhs(t, y, args)`` of the library."""

    function: Rhs

    def __call__(self, t: Any, y: Any, args: Any) -> Any:
        """The derivative of `y`."""
        return rhs_in_float64(self.function, t, y, args)


@json_shows("name", "frames", "t_start", "t_end", "parameters")
@dataclasses.dataclass(frozen=True, eq=False, repr=False)
class Problem(Displayed):
    """An initial value problem ``y' = rhs(t, y, args)``, ``y(ts[0]) = y0``.

    The state may be a pytree: a dict, a tuple of arrays, a named tuple, a dataclass registered
    with JAX. Then all functions below take and return such pytrees. The problem keeps the state
    and its right-hand side flat, as solvers and steppers need them; `unravel` goes back.

    Two problems are equal if their equations compute the same and their numbers are the same, to
    the last bit; what is known of their solutions does not count.

    Arguments:
        rhs: ``rhs(t, y, args)`` in JAX; returns the derivative in the shape of ``y``. It is traced
            once, when the problem is made: what it reads besides its arguments (a closure, a global
            variable) is what that was then. Where that changes, make a new problem.
        y0: the initial state, an array of any shape or a pytree of arrays; real numbers, kept as
            float64.
        ts: the sample times, increasing; ``ts[0]`` is the start. One interval between
            two of them is a frame.
        args: handed to `rhs`; any pytree of numbers and arrays.
        name: one word or two, for tables.
        energy: ``energy(t, y, args)`` in JAX, if there is one.
        exact: ``exact(ts)`` gives the exact states, shape ``(times, *y0.shape)``, in NumPy.
        jump_times: times inside the span at which `rhs` jumps. Steps end there.
        constraints: ``constraints(t, y, args)`` in JAX gives, for some of `quantities`, what
            is zero along each solution, in the units of the quantity.
        parameters: from which the library builds the problem, as plain JSON values; for a rope
            `kind`, `frames` and the arguments of `Rope`. Empty if there are none.
        mechanics: set by `Problem.second_order`.
        structure: set where the state is a pytree.

    Raises:
        InputError: one line for each argument that cannot be used.
        UserCodeError: `rhs` raised; its own exception is the cause.

    Examples:
        >>> from ropeode import Problem
        >>> decay = Problem(lambda t, y, rate: -rate * y, [1.0], [0.0, 1.0, 2.0], 0.5, "decay")
        >>> decay
        <Problem: decay, 2 frames>
        >>> decay.rhs(0.0, decay.y0, decay.args)
        array([-0.5])
    """

    rhs: Rhs
    y0: np.ndarray
    ts: np.ndarray
    args: Any = None
    name: str = "problem"
    energy: Callable[[Any, Any, Any], Any] | None = dataclasses.field(default=None, compare=False)
    exact: Callable[[np.ndarray], np.ndarray] | None = dataclasses.field(
        default=None, compare=False
    )
    jump_times: Sequence[float] = ()
    constraints: Callable[[Any, Any, Any], Mapping[str, Any]] | None = None
    parameters: Mapping[str, Any] = dataclasses.field(default_factory=dict)
    mechanics: Mechanics | None = None
    structure: StateStructure | None = None

    if TYPE_CHECKING:
        # Checked, and made arrays of.
        def __init__(
            self,
            rhs: Rhs,
            y0: Any,
            ts: ArrayLike,
            args: Any = None,
            name: str = "problem",
            energy: Callable[[Any, Any, Any], Any] | None = None,
            exact: Callable[[np.ndarray], Any] | None = None,
            jump_times: ArrayLike = (),
            constraints: Callable[[Any, Any, Any], Mapping[str, Any]] | None = None,
            parameters: Mapping[str, Any] = ...,
            mechanics: Mechanics | None = None,
            structure: StateStructure | None = None,
        ) -> None: ...

    def __new__(cls, *values: Any, **named: Any) -> Problem:
        """A problem before its checks; words that are none of its fields are refused by name."""
        del values
        refuse_others(named, [each.name for each in dataclasses.fields(cls)])
        return super().__new__(cls)

    def __post_init__(self) -> None:
        check_all(
            self._set_state,
            lambda: self._set("ts", checks.sample_times(self.ts)),
            lambda: checks.callable_or_none("exact", self.exact),
            lambda: checks.name_and_parameters(self.name, self.parameters),
        )
        self._set("jump_times", checks.jump_times(self.jump_times, self.ts))
        self._set("args", checks.numeric_pytree("args", self.args))
        start = self.ts[0]
        if isinstance(self.rhs, FirstOrderForm) and self.y0.shape[:1] == (2,):
            # Nothing else can fail in it, and this is compiled already.
            x0, v0 = self.y0
            own = checks.acceleration(self.rhs.acceleration, start, x0, v0, self.args)
            self._set("rhs", FirstOrderForm(own))
        else:
            own_rhs = checks.right_hand_side(self.rhs, start, self.y0, self.args)
            plain = isinstance(own_rhs, types.FunctionType)
            self._set("rhs", FirstOrderRhs(own_rhs) if plain else own_rhs)
        if self.energy is not None:
            self._set("energy", checks.energy(self.energy, start, self.y0, self.args))
        if self.constraints is not None:
            residuals = checks.constraints(
                self.constraints, start, self.y0, self.args, self.quantities
            )
            self._set("constraints", residuals)

    def _set_state(self) -> None:
        """Check the initial state; of a pytree, make the state and its functions flat."""
        if not is_tree(self.y0):
            self._set("y0", real_array("y0", self.y0))
            return
        structure, y0 = StateStructure.of("y0", self.y0, real_array)
        self._set("y0", y0)
        if structure == self.structure:
            # The functions are flat already: those of another problem.
            return
        self._set("structure", structure)
        self._set("rhs", structure.flat_rhs(self.rhs))
        for name in ("energy", "constraints"):
            if (function := getattr(self, name)) is not None:
                self._set(name, structure.flat(name, function))
        if callable(exact := self.exact):
            self._set("exact", structure.flat_exact(exact))

    def _set(self, name: str, value: Any) -> None:
        if isinstance(value, np.ndarray):
            value.flags.writeable = False
        object.__setattr__(self, name, value)

    def __setstate__(self, state: Mapping[str, Any]) -> None:
        # Of a pickle or a copy, whose arrays can be written to.
        for name, value in state.items():
            self._set(name, value)

    def changed(self, **fields: Any) -> Problem:
        """A copy with other fields, without checks.

        For problems that follow from a checked one: its equations in other units, or with other
        numbers of the same shapes.

        Arguments:
            fields: by name; arrays in float64.
        """
        other = copy.copy(self)
        for name, value in fields.items():
            if name in _NUMBERS:
                not_traced(name, value)
            other._set(name, value)
        return other

    @classmethod
    def without_equations(
        cls,
        missing: NoEquations,
        y0: np.ndarray,
        ts: np.ndarray,
        node_axis: int | None,
        **more: Any,
    ) -> Problem:
        """A problem of which only numbers are known; it can be shown and compared, but not run.

        Arguments:
            missing: is called in place of its functions, and raises.
            y0, ts: as for `Problem`, in float64.
            node_axis: as for `Mechanics`; None for a problem that is not mechanical.
            more: other fields of `Problem`.
        """
        mechanics = None if node_axis is None else Mechanics(missing, None, node_axis)
        empty = object.__new__(cls)
        return empty.changed(rhs=missing, y0=y0, ts=ts, mechanics=mechanics, **more)

    def require_equations(self) -> None:
        """Raises:
        InputError: it was read from a file that has no equations.
        """
        if isinstance(self.rhs, NoEquations):
            self.rhs()

    @classmethod
    def second_order(
        cls,
        acceleration: Acceleration,
        x0: Any,
        v0: Any,
        ts: Any,
        args: Any = None,
        *,
        damping: Callable[[Any], LinearDamping] | None = None,
        links: Callable[[Any], Links] | None = None,
        node_axis: int = 0,
        in_turn: bool = False,
        neighbours: bool = False,
        **more: Any,
    ) -> Problem:
        """A mechanical problem ``x'' = acceleration(t, x, v, args)``.

        Its state is ``stack([x, v])`` and its right-hand side ``stack([v, a])``.

        Arguments:
            acceleration: in JAX; returns an array of the shape of `x0`, all forces and the
                damping included.
            x0: initial positions: a number, ``(nodes,)`` or ``(nodes, dim)``.
            v0: initial velocities, of the shape of `x0`.
            ts: sample times, as for `Problem`.
            args: handed to `acceleration`.
            damping: ``damping(args)`` gives the `LinearDamping` inside `acceleration`, for
                steppers that treat damping on its own. Not needed where the acceleration
                does not depend on the velocity, which a few trials show.
            links: ``links(args)`` gives the `Links` of nodes that stand in a row; for such,
                positions are stored ``(dim, nodes)``.
            node_axis: 1 where positions are stored ``(dim, nodes)``.
            in_turn: whether these functions take ropes whose nodes stand in turn (`Links`).
            neighbours: whether the acceleration of each node depends on itself and its neighbours
                in the row of `links` alone, which makes implicit steppers faster.
            more: `name`, `energy`, `exact`, `jump_times`, `constraints` and `parameters` of
                `Problem`.

        Raises:
            InputError: an argument cannot be used, or `damping` is not what the
                acceleration does.

        Examples:
            >>> from ropeode import Problem
            >>> spring = Problem.second_order(lambda t, x, v, k: -k * x, [1], [0], [0, 1, 2], 4)
            >>> spring.y0.shape
            (2, 1)
            >>> spring.rhs(0.0, spring.y0, spring.args)
            array([[ 0.],
                   [-4.]])
        """
        refuse_others(more, (*_MORE, "damping", "links", "node_axis", "in_turn", "neighbours"))
        if is_tree(x0):
            fix = "write them as one, or use Problem(rhs, {'x': x0, 'v': v0}, ts)"
            raise bad_value("x0", x0, "one array of positions", fix)
        x0 = real_array("x0", x0)
        v0 = real_array("v0", v0)
        if x0.shape != v0.shape:
            raise bad_value(
                "v0",
                v0.shape,
                f"an array of the shape of x0, {x0.shape}",
                "give each position its velocity",
            )
        if x0.ndim > 2:
            raise bad_value("x0", x0.shape, "a number, (nodes,) or (nodes, dim)", "reshape it")
        ts = checks.sample_times(ts)
        args = checks.numeric_pytree("args", args)
        acceleration = checks.acceleration(acceleration, ts[0], x0, v0, args)
        if links is not None:
            links = checks.links(links, x0, node_axis, args)
        if damping is not None:
            damping = checks.damping(damping, args)
        still, moving = _trials(acceleration, ts, x0, v0, args)
        if damping is None:
            if all(np.array_equal(still, a, equal_nan=True) for _, a in moving):
                damping = no_damping
        elif not _is_the_damping(damping, args, still, moving):
            raise InputError(
                "damping: the acceleration does not change with the velocity by -rate * v, where "
                "rate is that of damping(args); allowed: the rate in the acceleration. Fix: let "
                "damping(args) return that rate, or leave damping out."
            )
        return cls(
            rhs=FirstOrderForm(acceleration),
            y0=np.stack([x0, v0]),
            ts=ts,
            args=args,
            mechanics=Mechanics(acceleration, damping, node_axis, links, in_turn, neighbours),
            **more,
        )

    @classmethod
    def from_scipy(
        cls,
        fun: Callable,
        t_span_or_ts: Any = None,
        y0: Any = None,
        args: Any = (),
        *,
        frames: int | None = None,
        **more: Any,
    ) -> Problem:
        """A problem written for `scipy.integrate.solve_ivp`, in NumPy.

        If JAX can trace `fun` and then computes the same, the problem is like any other.
        Otherwise `fun` runs in Python wherever the right-hand side is needed (`in_python`), with
        the same certificate, but more slowly.

        Arguments:
            fun: ``fun(t, y, *args)`` returns the derivative of `y`, as an array or a list.
            t_span_or_ts: a span of two times, which is divided into equal frames, or three or more
                sample times.
            y0: the initial state, ``(n,)``.
            args: a tuple of what `fun` takes after `t` and `y`; numbers among them become `args`
                of the problem if all are numbers or arrays.
            frames: of a span; 20 by default.
            more: `name`, `energy`, `exact`, `jump_times`, `constraints` and `parameters` of
                `Problem`.

        Raises:
            InputError: an argument cannot be used.
            UserCodeError: `fun` raised, or the same arguments gave different results.

        Examples:
            >>> from ropeode import Problem
            >>> turn = Problem.from_scipy(lambda t, y: [y[1], -y[0]], (0, 2), [1, 0], frames=4)
            >>> turn.ts
            array([0. , 0.5, 1. , 1.5, 2. ])
        """
        refuse_others(more, _MORE)
        return cls(**{**scipy_form(fun, t_span_or_ts, y0, args, frames), **more})

    @in_float64
    def to_scipy(self) -> dict[str, Any]:
        """The problem as `scipy.integrate.solve_ivp` takes it, in float64.

        As in ``solve_ivp(**problem.to_scipy(), method="DOP853", rtol=1e-10)``. The states that it
        returns can be held against a reference as they are: ``error_series(found, reference)``.

        Returns:
            `fun`, which is ``fun(t, y)`` or ``fun(t, y, args)`` with other arguments than the
            problem's, of flat states ``(n,)``, whatever the configuration of JAX; `t_span`; `y0`,
            ``(n,)``; and `t_eval`, the sample times. ``fun.jac(t, y)`` is its Jacobian, ``(n, n)``,
            for implicit methods: ``solve_ivp(**ivp, method="Radau", jac=ivp["fun"].jac)``.

        Raises:
            InputError: the problem has no equations.
            UserCodeError: a function of the user's raised.

        Examples:
            >>> from scipy.integrate import solve_ivp
            >>> from ropeode import Rope
            >>> ivp = Rope(num_nodes=4).problem(frames=3).to_scipy()
            >>> solve_ivp(**ivp, method="DOP853", rtol=1e-9).y.shape
            (16, 4)
        """
        self.require_equations()
        return {
            "fun": ScipyFunction(self.rhs, self.y0.shape, self.args),
            "t_span": (self.t_start, self.t_end),
            "y0": np.array(self.y0).ravel(),
            "t_eval": np.array(self.ts),
        }

    @property
    def in_python(self) -> bool:
        """Whether the right-hand side runs in Python, some 10 us for each evaluation or more."""
        return isinstance(self.rhs, PythonRhs)

    def with_numbers(self, y0: Any, args: Any, parameters: Mapping[str, Any]) -> Problem:
        """The same functions with other numbers, without new checks.

        Arguments:
            y0: initial state, an array of the shape of this one's.
            args: arguments, arrays of the shapes of this one's.
            parameters: of the new problem.
        """
        # An exact solution may depend on the old numbers.
        return self.changed(y0=y0, args=args, parameters=parameters, exact=None)

    @property
    def quantities(self) -> tuple[str, ...]:
        """The quantities that have errors: position and velocity, or the state."""
        return ("state",) if self.mechanics is None else ("position", "velocity")

    @property
    def t_start(self) -> float:
        """The first sample time."""
        return float(self.ts[0])

    @property
    def t_end(self) -> float:
        """The last sample time."""
        return float(self.ts[-1])

    @property
    def frames(self) -> int:
        """The number of intervals between sample times."""
        return len(self.ts) - 1

    def until(self, samples: int) -> Problem:
        """The problem up to one of its samples.

        Arguments:
            samples: how many leading sample times to keep, 2 or more.

        Examples:
            >>> from ropeode import Rope
            >>> Rope(num_nodes=4).problem(frames=3).until(2).ts
            array([0., 1.])
        """
        ts = self.ts[:samples]
        return self.changed(ts=ts, jump_times=tuple(t for t in self.jump_times if t < ts[-1]))

    @property
    def equal_frames(self) -> bool:
        """Whether the sample times are equally spaced, to rounding."""
        gaps = np.diff(self.ts)
        return bool(np.ptp(gaps) <= 1e-12 * np.max(np.abs(self.ts)))

    def unravel(self, states: Any) -> Any:
        """States as pytrees like the initial state; those of a state that is one array as they are.

        Arguments:
            states: shape ``(times, *y0.shape)``, or one of them.

        Returns:
            A pytree whose arrays are those of the initial state, with an axis of times in front.

        Examples:
            >>> from ropeode import Problem
            >>> start = {"x": 1.0, "v": 0.0}
            >>> turn = Problem(lambda t, y, args: {"x": y["v"], "v": -y["x"]}, start, [0.0, 1.0])
            >>> turn.y0
            array([0., 1.])
            >>> turn.unravel(turn.y0)
            {'v': array(0.), 'x': array(1.)}
        """
        return states if self.structure is None else self.structure.unravel(states)

    def quantity(self, name: str, states: np.ndarray) -> np.ndarray:
        """One of `quantities` of states, as ``(times, nodes, dim)``.

        A state that is not mechanical counts as nodes of one component each.

        Arguments:
            name: one of `quantities`.
            states: shape ``(times, *y0.shape)``.

        Examples:
            >>> from ropeode import Rope, simulate
            >>> run = simulate(Rope(num_nodes=4).problem(frames=3), "rk4", steps_per_frame=16)
            >>> run.problem.quantities
            ('position', 'velocity')
            >>> run.problem.quantity("velocity", run.states)[-1, 3].round(2)
            array([ 0.09, -2.96])
        """
        if self.mechanics is None:
            return states.reshape(len(states), -1, 1)
        half = states[:, self.quantities.index(name)]
        if half.ndim < 3:
            return half.reshape(len(half), -1, 1)
        return np.moveaxis(half, 1 + self.mechanics.node_axis, 1)

    def positions(self, states: np.ndarray) -> np.ndarray:
        """Positions of states, ``(times, nodes, dim)``.

        Raises:
            InputError: this is not a second-order problem.

        Examples:
            >>> from ropeode import Rope, simulate
            >>> run = simulate(Rope(num_nodes=4).problem(frames=3), "rk4", steps_per_frame=16)
            >>> run.problem.positions(run.states)[-1, 3].round(2)
            array([-399.93,  195.54])
        """
        self.require_mechanics("positions")
        return self.quantity("position", states)

    def velocities(self, states: np.ndarray) -> np.ndarray:
        """Velocities of states, ``(times, nodes, dim)``.

        Raises:
            InputError: this is not a second-order problem.

        Examples:
            >>> from ropeode import Rope, simulate
            >>> run = simulate(Rope(num_nodes=4).problem(frames=3), "rk4", steps_per_frame=16)
            >>> run.problem.velocities(run.states)[-1, 3].round(2)
            array([ 0.09, -2.96])
        """
        self.require_mechanics("velocities")
        return self.quantity("velocity", states)

    def require_mechanics(self, what: str) -> Mechanics:
        """`mechanics`, or a complaint that `what` needs them.

        Raises:
            InputError: this is not a second-order problem.
        """
        if self.mechanics is None:
            raise bad_value(
                what,
                self.name,
                "a second-order (mechanical) problem",
                "build the problem with Problem.second_order(acceleration, x0, v0, ts)",
            )
        return self.mechanics

    @in_float64
    def energies(self, states: np.ndarray) -> np.ndarray:
        """The energy of each state, shape ``(times,)``.

        Arguments:
            states: shape ``(times, *y0.shape)``, taken at the first sample times.

        Raises:
            InputError: the problem has no energy.

        Examples:
            >>> from ropeode import Rope, simulate
            >>> run = simulate(Rope(num_nodes=4).problem(frames=3), "rk4", steps_per_frame=16)
            >>> run.problem.energies(run.states).round(2)
            array([800.  , 799.99, 799.92, 799.74])
        """
        self.require_equations()
        if self.energy is None:
            raise bad_value("energy", None, "a function energy(t, y, args)", "pass energy=...")
        every = for_each_state(self.energy)
        return np.asarray(every(self.ts[: len(states)], states, self.args))

    @property
    def rigid(self) -> bool:
        """Whether it has constraints that hold at every time."""
        return self.constraints is not None

    @in_float64
    def drift(self, states: np.ndarray) -> dict[str, np.ndarray]:
        """The largest violation of the constraints, for each quantity, ``(times,)``.

        Arguments:
            states: shape ``(times, *y0.shape)``, taken at the first sample times.

        Examples:
            >>> from ropeode import InextensibleRope, simulate
            >>> rope = InextensibleRope(num_nodes=4).problem(frames=3)
            >>> drift = rope.drift(simulate(rope, "rk4", steps_per_frame=1).states)
            >>> {quantity: f"{values.max():.0e}" for quantity, values in drift.items()}
            {'position': '6e-06', 'velocity': '3e-07'}
        """
        if self.constraints is None:
            return {}
        every = for_each_state(self.constraints)
        return {
            quantity: np.max(np.abs(residual).reshape(len(states), -1), axis=1, initial=0.0)
            for quantity, residual in every(self.ts[: len(states)], states, self.args).items()
        }

    @property
    def scale(self) -> float:
        """The size of the initial state's largest component; 1 where all are zero."""
        largest = float(np.max(np.abs(self.y0), initial=0.0))
        return largest if largest > 0 else 1.0


# Not that of `__new__`, which help and completion would show.
_fields = inspect.signature(Problem.__init__)
_own = _fields.replace(parameters=list(_fields.parameters.values())[1:])
setattr(Problem, "__signature__", _own)  # noqa: B010


def require_problem(given: Any) -> None:
    """Raises:
    InputError: it is no problem.
    """
    if isinstance(given, Problem):
        return
    fix = "write Problem(rhs, y0, ts) for a right-hand side in JAX"
    if isinstance(given, str):
        fix = "from ropeode.problems.files import load_problem, and write load_problem(...)"
    elif callable(getattr(given, "problem", None)):
        fix = "hand over its problem, as in rope.problem(frames=20)"
    elif callable(given):
        fix += ", or Problem.from_scipy(fun, (t0, t1), y0) for one in NumPy"
    raise bad_value("problem", given, "a Problem", fix)


def require_memory(problem: Problem, copies: int) -> None:
    """Refuse a problem whose states at all samples do not fit into memory.

    Arguments:
        problem: is to be solved.
        copies: how many of all these states there are at the same time.

    Raises:
        InputError: they need more memory than there is.
    """
    check_memory(problem.frames, copies * problem.y0.nbytes)


def no_damping(args: Any) -> LinearDamping:
    """The damping of a problem that has none."""
    del args
    return LinearDamping(0.0, 0.0)


@in_float64
def _is_the_damping(
    damping: Callable[[Any], LinearDamping],
    args: Any,
    still: np.ndarray,
    trials: list[tuple[np.ndarray, np.ndarray]],
) -> bool:
    rate = np.asarray(damping(args).rate)
    for v, moving in trials:
        size = np.max(np.abs(still)) + np.max(np.abs(moving))
        # What is smaller than any normal number counts as zero to XLA, but not to NumPy.
        rounding = np.finfo(np.float64).tiny * (1.0 + np.max(np.abs(v)))
        if np.max(np.abs(moving - (still - rate * v))) > 1e-12 * size + rounding:
            return False
    return True


@in_float64
def _trials(
    acceleration: Acceleration, ts: np.ndarray, x0: np.ndarray, v0: np.ndarray, args: Any
) -> tuple[np.ndarray, list[tuple[np.ndarray, np.ndarray]]]:
    """The acceleration at rest, and a few velocities with the acceleration at each of them."""

    def at(v: np.ndarray) -> np.ndarray:
        return np.asarray(compiled(acceleration)(ts[0], x0, v, args))

    # Not symmetric in any way, and of the problem's size.
    draw = np.random.default_rng(20).normal(size=(3, *v0.shape))
    velocities = draw * max(1.0, float(np.max(np.abs(v0), initial=0.0)))
    return at(np.zeros(x0.shape)), [(v, at(v)) for v in velocities]
