"""The driver: a problem, a stepper and a step size make a trajectory."""

from ropeode.simulation.run import simulate, simulate_chunks
from ropeode.simulation.system import system
from ropeode.simulation.trajectory import Trajectories, Trajectory, step_size

__all__ = ["Trajectories", "Trajectory", "simulate", "simulate_chunks", "step_size", "system"]
