"""The driver: a problem, a stepper and a step size make a trajectory."""

from ropeode.simulation.jax_stepper import JaxStepper, jax_stepper
from ropeode.simulation.method import Method, method_of
from ropeode.simulation.python_driver import one_at_a_time, take_turn_from
from ropeode.simulation.run import simulate, simulate_chunks
from ropeode.simulation.trajectory import Trajectories, Trajectory, step_size
from ropeode.simulation.user_clock import TimeIsUp, UserClock, on_user_clock

__all__ = [
    "JaxStepper",
    "Method",
    "TimeIsUp",
    "Trajectories",
    "Trajectory",
    "UserClock",
    "jax_stepper",
    "method_of",
    "on_user_clock",
    "one_at_a_time",
    "simulate",
    "simulate_chunks",
    "step_size",
    "take_turn_from",
]
