"""What a stepper is: a one-step map, and the facts that it declares about itself."""

from __future__ import annotations

import abc
import dataclasses
import functools
from collections.abc import Callable
from typing import Any, ClassVar, Literal, NamedTuple, get_args, get_type_hints

import jax.numpy as jnp
import numpy as np

from ropeode.errors import InputError
from ropeode.problems import Problem, StateStructure
from ropeode.problems.links import LinearDamping, Links, taut_between
from ropeode.validation import bad_value, check_whole, unknown

# The largest number that an option may have: loops count in 32 bits at least.
_MOST = 2**31 - 1


class ProblemClass(NamedTuple):
    """What the order of a stepper may depend on.

    Fields:
        damped: the acceleration contains damping.
        at_rest: all initial velocities are zero.
        rigid: its nodes are joined by rigid links (a rope that is not: by springs).

    Examples:
        >>> from ropeode import ProblemClass, as_stepper
        >>> verlet = as_stepper("stormer-verlet:damping=lagged")
        >>> verlet.order(ProblemClass()), verlet.order(ProblemClass(damped=True))
        (2, 1)
    """

    damped: bool = False
    at_rest: bool = True
    rigid: bool = False


class Equations(NamedTuple):
    """A problem's functions as step functions are handed them, with `args` last.

    Fields:
        rhs: ``rhs(t, y, args)``.
        acceleration: ``acceleration(t, x, v, args)``, of positions and velocities ``(nodes, dim)``.
        args: of the problem.
    """

    rhs: Callable[[Any, Any, Any], Any]
    acceleration: Callable[[Any, Any, Any, Any], Any]
    args: Any


@dataclasses.dataclass(frozen=True)
class System:
    """A problem as a stepper sees it: functions of time and state alone.

    Arguments:
        equations: its functions with `args` last, as step functions take them.
        mechanical: whether the problem has positions and velocities.
        damping: the `LinearDamping` inside the acceleration; None if it is not known.
        links: the `Links` between neighbours; None if nodes do not stand in a row.
        once: hands on a value that several places read, such as a slope, so that it is computed
            once: a compiler may do it in each of them.
        neighbours: whether the acceleration of each node depends on itself and its neighbours in
            the row alone.

    Examples:
        >>> from ropeode import Phase, Rope, Stepper, simulate
        >>> class Symplectic(Stepper):
        ...     needs = "second order"
        ...     def step(self, system, t, carried, dt):
        ...         v = carried.v + dt * system.acceleration(t, carried.x, carried.v)
        ...         return Phase(carried.x + dt * v, v)
        >>> simulate(Rope(num_nodes=4).problem(frames=3), Symplectic(), steps_per_frame=16)
        <Trajectory: Symplectic, 16 steps/frame; rope, 4 nodes, damping 0.01, 3 frames; ok,
        4 samples>
    """

    equations: Equations
    mechanical: bool
    damping: LinearDamping | None = None
    links: Links | None = None
    once: Callable[[Any], Any] = dataclasses.field(default_factory=lambda: _as_it_is)
    neighbours: bool = False

    def rhs(self, t: Any, y: Any) -> Any:
        """The right-hand side. For a mechanical problem `y` and the result are `Phase` values."""
        return self.equations.rhs(t, y, self.equations.args)

    def acceleration(self, t: Any, x: Any, v: Any) -> Any:
        """Of positions and velocities ``(nodes, dim)``.

        Raises:
            InputError: the problem is not mechanical.
        """
        return self.equations.acceleration(t, x, v, self.equations.args)

    def undamped_acceleration(self, t: Any, x: Any) -> Any:
        """The acceleration without its damping part, which is linear in the velocity."""
        return self.acceleration(t, x, jnp.zeros_like(x))


def _as_it_is(value: Any) -> Any:
    return value


class Stepper(abc.ABC):
    """A method with a fixed step size. Derive from it what a function cannot say.

    The driver calls `init` at the start, and again at each of the problem's `jump_times`, and then
    `step` for each step; `state` is called where a sample is due. What is carried from step to step
    is the stepper's own affair: any nesting of tuples, named tuples and arrays. By default it is
    the state. `t` and `dt` are numbers; for a mechanical problem the state is a `Phase`, whose
    ``y.x`` and ``y.v`` are arrays ``(nodes, dim)``; for any other it is an array. ``ropeode check
    --template two-step`` prints an example. All class attributes have defaults.

    Class attributes:
        name: as it is typed on the command line; by default that of the class.
        family: of methods that it belongs to, by which lists and plots group it.
        needs: the kind of problem that it can run on.
        keeps_lengths: whether it takes springs for rigid links, and so solves ropes with rigid
            links alone.
        symplectic: whether it is, on problems without damping; None where nothing is claimed.
        source: the paper or book that it is from.
        equal_frames: whether all sample times must be equally far apart (two-step methods).
        compiled: whether JAX compiles its runs. None leaves that to a trial: what JAX can trace,
            with the same results, is compiled, and the rest runs in Python.
        any_layout: whether it works whichever axis counts the nodes, and on several ropes whose
            nodes stand in turn (see `Links`). If not, it is handed ``(nodes, dim)``.

    Examples:
        >>> from ropeode import Rope, Stepper, simulate
        >>> class Midpoint(Stepper):
        ...     def step(self, system, t, carried, dt):
        ...         half = carried + dt / 2 * system.rhs(t, carried)
        ...         return carried + dt * system.rhs(t + dt / 2, half)
        >>> simulate(Rope(num_nodes=4).problem(frames=3), Midpoint(), steps_per_frame=16)
        <Trajectory: Midpoint, 16 steps/frame; rope, 4 nodes, damping 0.01, 3 frames; ok, 4 samples>
    """

    name: ClassVar[str] = ""
    family: ClassVar[str] = "your own"
    needs: ClassVar[
        Literal[
            "any ODE",
            "second order",
            "second order, linear damping",
            "second order, no damping",
            "nodes in a row",
            "springs in a row",
        ]
    ] = "any ODE"
    keeps_lengths: ClassVar[bool] = False
    symplectic: ClassVar[bool | None] = None
    source: ClassVar[str] = ""
    equal_frames: ClassVar[bool] = False
    compiled: ClassVar[bool | None] = None
    any_layout: ClassVar[bool] = False

    def order(self, problem_class: ProblemClass) -> int | None:
        """The order of convergence that it declares; None where it declares none.

        0 stands for a stepper that converges to another solution, or to none.

        Examples:
            >>> from ropeode import ProblemClass, as_stepper
            >>> as_stepper("rk4").order(ProblemClass())
            4
            >>> as_stepper("stormer-verlet:damping=lagged").order(ProblemClass(damped=True))
            1
        """
        del problem_class
        return None

    def init(self, system: System, t: Any, y: Any, dt: Any) -> Any:
        """What is carried into the first step.

        Arguments:
            system: the problem.
            t: initial time.
            y: initial state; a `Phase` for a mechanical problem.
            dt: step size.
        """
        del system, t, dt
        return y

    @abc.abstractmethod
    def step(self, system: System, t: Any, carried: Any, dt: Any) -> Any:
        """Advance what is carried from time `t` to ``t + dt``."""

    def state(self, system: System, t: Any, carried: Any, dt: Any) -> Any:
        """The state at time `t`, from what is carried."""
        del system, t, dt
        return carried

    def solved(self, carried: Any) -> Any:
        """Whether all equations of its steps so far were solved, from what is carried.

        An implicit step whose iterations do not converge returns not-a-number, and this says why
        the run ends there. True, or an array of truths, one for each of several ropes in turn.

        Examples:
            >>> from ropeode import Problem, simulate
            >>> burst = Problem(lambda t, y, args: y**2, [1.0], [0.0, 0.5])
            >>> simulate(burst, "implicit-euler", 1)  # 1 + y^2/2 = y has no solution.
            <Trajectory: implicit-euler, 1 step/frame; problem, 1 frame; unsolved at frame 1,
            1 sample>
        """
        del carried
        return True

    def jacobian_evaluations(self, carried: Any) -> Any:
        """How often its steps evaluated the Jacobian so far, and the right-hand side with it.

        None where nobody counts what happens in its loops.

        Examples:
            >>> from ropeode import Rope, simulate
            >>> rope = Rope(num_nodes=4).problem(frames=3)
            >>> simulate(rope, "implicit-euler:newton=1", 16).jacobian_evaluations
            48
        """
        del carried
        return None

    def solves(self, problem_class: ProblemClass) -> bool:
        """Whether it is meant for such problems; if not, it solves another problem."""
        return problem_class.rigid or not self.keeps_lengths

    @property
    def moves_links(self) -> bool:
        """Whether it moves nodes link by link, and asks for no right-hand side."""
        return self.needs in ("nodes in a row", "springs in a row")

    @property
    def label(self) -> str:
        """What it is called in tables and plots."""
        return self.name or type(self).__name__

    def require(self, problem: Problem) -> None:
        """See that this stepper can run on a problem.

        Raises:
            InputError: it cannot, and why.
        """
        problem.require_equations()
        if refusal := self.refusal(problem):
            raise InputError(refusal)

    def on(self, structure: StateStructure | None) -> Stepper:
        """The stepper for problems whose state has a structure; itself, if it takes flat states.

        Arguments:
            structure: of the state; None where it is one array.
        """
        del structure
        return self

    def refusal(self, problem: Problem) -> str | None:
        """Why this stepper cannot run on a problem; None if it can."""
        mechanics, name = problem.mechanics, repr(problem.name)

        def because(why: str, allowed: str, fix: str) -> str:
            return f"stepper: {self.label!r} given, {why}; allowed: {allowed}. Fix: {fix}."

        if self.equal_frames and not problem.equal_frames:
            any_ode = self.needs == "any ODE"
            one_step = "heun (trapezium if it is stiff)" if any_ode else "velocity-verlet"
            return because(
                "a multistep method that needs one step size, and the sample times of "
                f"{name} are not equally spaced",
                "one-step methods",
                f"choose {one_step}, or equally spaced sample times",
            )
        if self.needs == "any ODE":
            return None
        for_forces = "steppers for forces, such as semi-implicit-euler"
        if self.moves_links:
            if mechanics is None or mechanics.links is None:
                return because(
                    f"which moves nodes in a row link by link, and {name} has no such nodes",
                    for_forces,
                    "choose one of them, or solve a rope",
                )
            links = mechanics.links(problem.args)
            rigid = np.broadcast_to(links.compliance == 0, np.shape(links.length))
            if self.needs == "springs in a row" and np.any(rigid):
                return because(
                    f"whose links are springs, and {name} has rigid ones",
                    "steppers for rigid links, such as rattle and xpbd",
                    "choose one of them, or solve a rope with springs",
                )
            if self.keeps_lengths and (pins := taut_between(links, problem.y0[0])):
                return because(
                    f"whose links are rigid, and {name} is taut between the pinned nodes "
                    f"{pins[0]} and {pins[1]}, so that what is between them could not move",
                    for_forces,
                    "choose one of them, or leave out a pin",
                )
            return None
        if mechanics is None:
            return because(
                f"which needs a second-order problem, and {name} is a first-order one",
                "steppers for any ODE, such as explicit-euler and rk4",
                "choose one of them, or build the problem with "
                "Problem.second_order(acceleration, x0, v0, ts)",
            )
        if self.needs == "second order, no damping" and (
            mechanics.damping is None or np.any(mechanics.damping(problem.args).rate)
        ):
            return because(
                "which takes forces that depend on time and positions only, and the acceleration "
                f"of {name} depends on the velocities",
                "steppers for any second-order problem",
                "choose another one, such as semi-implicit-euler, or set the damping to 0",
            )
        if self.needs == "second order, linear damping" and mechanics.damping is None:
            return because(
                f"which treats damping on its own, and the acceleration of {name} depends on the "
                "velocity in a way that is not declared",
                "steppers that need no more than a second-order problem, such as "
                "semi-implicit-euler",
                "choose one of them, or declare linear damping with "
                "Problem.second_order(..., damping=...)",
            )
        return None


@functools.cache
def _choices(cls: type) -> dict[str, tuple[str, ...]]:
    """Of options that are a `Literal`."""
    return {name: get_args(hint) for name, hint in get_type_hints(cls).items()}


@dataclasses.dataclass(frozen=True)
class BuiltIn(Stepper):
    """A stepper of ropeode.

    Subclasses are frozen dataclasses whose fields are their options, each a `Literal` of the
    choices, or an `int` for a number from 1 on.
    """

    symplectic = False
    compiled = True
    any_layout = True

    def __post_init__(self) -> None:
        for option in dataclasses.fields(self):
            name, given = f"{self.name}:{option.name}", getattr(self, option.name)
            if option.type == "int":
                value = check_whole(name, given, at_least=1, example="4")
                if value > _MOST:
                    raise bad_value(name, value, f"at most {_MOST}", "take fewer")
            else:
                # A number may be given as one, as in newton=1.
                value = str(given)
                if value not in (choices := _choices(type(self))[option.name]):
                    raise InputError(unknown(name, value, choices))
            object.__setattr__(self, option.name, value)

    @property
    def label(self) -> str:
        """The name with the options that differ from their defaults."""
        chosen = [
            f"{option.name}={getattr(self, option.name)}"
            for option in dataclasses.fields(self)
            if getattr(self, option.name) != option.default
        ]
        return self.name + (":" + ",".join(chosen) if chosen else "")
