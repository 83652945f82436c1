"""The driver: a problem, a stepper and a step size make a trajectory."""

from ropeode.simulation.jax_stepper import JaxStepper, jax_stepper
from ropeode.simulation.run import simulate, simulate_chunks
from ropeode.simulation.system import system
from ropeode.simulation.trajectory import Trajectories, Trajectory, step_size

__all__ = [
    "JaxStepper",
    "Trajectories",
    "Trajectory",
    "jax_stepper",
    "simulate",
    "simulate_chunks",
    "step_size",
    "system",
]
