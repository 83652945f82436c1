"""What is shown of a run beside the reference."""

from __future__ import annotations

import numpy as np

from ropeode.analysis import distances_from, energy_errors
from ropeode.laboratory.certified_motion import CertifiedMotion
from ropeode.laboratory.drawings import finite_samples


def differences_of(
    motion: CertifiedMotion, states: np.ndarray, every: int
) -> dict[str, np.ndarray]:
    """The arrays of a `ropeode.laboratory.messages.Run`, in float64.

    Arguments:
        motion: the reference.
        states: of the run at its leading samples, ``(times, *state)``.
        every: so manieth of the reference's samples.
    """
    finer, problem = motion.finer, motion.sampled(every)
    with np.errstate(over="ignore", invalid="ignore"):
        drawn = motion.drawing.points(problem.ts[: len(states)], states)
        count = finite_samples(drawn)
        differences = drawn[:count] - motion.points[::every][:count]
    trusted = min(len(states), -(-finer.trusted // every))
    truth = finer.states[::every][:trusted]
    arrays = {
        "differences": differences,
        "errors": distances_from(truth, states[:trusted], problem, motion.norm),
    }
    if motion.energy is not None:
        # As many states each time, so that one compilation serves runs that ended early.
        missing = len(problem.ts) - len(states)
        whole = np.concatenate([states, np.repeat(problem.y0[None], missing, axis=0)])
        energies = problem.energies(whole)[: len(states)]
        arrays["energy_differences"] = energy_errors(energies, motion.energy.values[::every])
    return {name: each[: finite_samples(each)] for name, each in arrays.items()}
