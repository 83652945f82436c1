"""Hold old releases of other packages, whose faults are known, and the mended ones, to account.

    make old-releases

Each release is installed in an environment of its own, without ropeode, and writes its
trajectories into a file; ropeode says which are wrong.
"""

from __future__ import annotations

import argparse
import dataclasses
import subprocess
import sys
import tempfile
from collections.abc import Callable, Mapping
from pathlib import Path

import jax
import numpy as np

from ropeode import reference
from ropeode.checking import (
    convergence_finding,
    convergence_problems,
    converging,
    generic,
    reference_of,
)
from ropeode.norms import NORMS, distance
from ropeode.simulation import step_size

HERE = Path(__file__).parent
STEPS = (1, 2, 3, 4, 5, 6, 7, 8, 10, 12, 14, 17, 20, 24, 29, 35, 42, 50)
RTOLS = 10.0 ** -np.arange(3, 10)
POINTS = 12
# Inside a step the error may be a little larger than at the worse of its ends.
LARGER = 2.0


@dataclasses.dataclass(frozen=True)
class Case:
    """A fault of a release.

    Arguments:
        script: that makes the trajectories.
        wrong: the last release with the fault.
        right: the first one without.
        given: what the script is given, by name.
        judged: what ropeode finds wrong, and all that it measured, as lines.
    """

    script: str
    wrong: str
    right: str
    given: Callable[[], dict[str, np.ndarray]]
    judged: Callable[[Mapping[str, np.ndarray]], tuple[list[str], list[str]]]


def numbers(problem):
    """A check rope as arrays."""
    fields = {"y0": problem.y0, "ts": problem.ts, **problem.args._asdict()}
    return {f"{problem.name}/{name}": np.asarray(value) for name, value in fields.items()}


def all_ropes():
    """All check ropes, and with how many steps per frame they are run."""
    given = {"steps": np.array(STEPS)}
    for problem in convergence_problems().values():
        given |= numbers(problem)
    return given


def of_order(expected):
    """Whether runs of all check ropes are of an order."""

    def judged(found):
        faults, lines = [], []
        for name, problem in convergence_problems().items():
            known = reference_of(problem)
            dts = [step_size(problem, steps) for steps in STEPS]
            runs = [(dt, states, None) for dt, states in zip(dts, found[name], strict=True)]
            finding = convergence_finding(name, converging(known, runs, expected=expected))
            lines.append(f"{name}: {finding.line}")
            faults += [name] if finding.status == "fail" else []
        return faults, lines

    return judged


def damped():
    """A check rope in syrup: LSODA changes methods and orders on it."""
    args = generic().args
    damping = np.full_like(args.damping, 30.0)
    return generic().changed(
        args=args._replace(damping=damping), ts=np.linspace(0.0, 20.0, 5), name="damped"
    )


def one_rope():
    """That one, and the tolerances."""
    return {"rtols": RTOLS, "points": np.array(POINTS), **numbers(damped())}


def dense_output(found):
    """Whether errors between the ends of steps are as small as those at the ends."""
    known, norm = reference(damped()), NORMS["position-max"]
    faults, lines = [], []
    for i, rtol in enumerate(RTOLS):
        times, states = found[f"times/{i}"], found[f"states/{i}"]
        flat = states.reshape(-1, *known.problem.y0.shape)
        apart = distance(known.problem, norm, flat, known.at(times.ravel()))
        errors = apart.reshape(times.shape)
        least = max(1e-2 * rtol, 10.0 * float(known.bound(norm)[-1]))
        ends = np.maximum(np.maximum(errors[:, 0], errors[:, -1]), least)
        worse = float(np.max(np.max(errors[:, 1:-1], axis=1) / ends))
        lines.append(
            f"rtol {rtol:.0e}: inside a step up to {worse:.1f} times the error at its ends"
        )
        faults += [f"rtol {rtol:.0e}"] if worse > LARGER else []
    return faults, lines


CASES = (
    Case("daceypy_rk78.py", "daceypy-1.3.0", "daceypy-1.3.1", all_ropes, of_order(7)),
    Case("pathsim_rkf45.py", "pathsim-0.23.1", "pathsim-0.23.2", all_ropes, of_order(5)),
    Case("scipy_lsoda.py", "scipy-1.11.4", "scipy-1.12.0", one_rope, dense_output),
)


def trajectories(case, release, environments, folder):
    """What the script writes under a release."""
    source, target = folder / f"{case.script}.npz", folder / f"{release}.npz"
    np.savez(source, **case.given())
    python = environments / release / "bin" / "python"
    subprocess.run([python, HERE / case.script, source, target], check=True)
    return np.load(target)


def main():
    """Judge all releases; exit code 1 if a wrong one passes or a mended one does not."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("environments", type=Path, help="folder with one environment per release")
    environments = parser.parse_args().environments
    as_expected = True
    with tempfile.TemporaryDirectory() as folder:
        for case in CASES:
            for release in (case.wrong, case.right):
                found = trajectories(case, release, environments, Path(folder))
                faults, lines = case.judged(found)
                as_expected &= bool(faults) == (release == case.wrong)
                verdict = f"wrong ({', '.join(faults)})" if faults else "right"
                print(f"{release}: {verdict}", *lines, sep="\n    ", flush=True)
    return 0 if as_expected else 1


if __name__ == "__main__":
    with jax.enable_x64(True):
        sys.exit(main())
