"""The runs behind the figures: side by side where they can be, and kept until all are done."""

from __future__ import annotations

import contextlib
import dataclasses
import hashlib
import io
import json
import threading
import zipfile
import zlib
from collections.abc import Callable, Iterable, Sequence
from importlib import metadata
from pathlib import Path

import numpy as np

from ropeode.analysis.motion import DEFAULTS
from ropeode.analysis.stability import Growth, growth_per_frame
from ropeode.case_studies.figures import ENDS, Figure, Meaning
from ropeode.errors import InputError
from ropeode.files import write_whole
from ropeode.problems.ensemble import Ensemble
from ropeode.problems.problem import Problem
from ropeode.simulation import Trajectory, simulate
from ropeode.steppers import as_stepper
from ropeode.threads import cores, threads

FRAMES = 4000
MOST_FRAMES = 20_000
# No run takes more steps than 4000 frames of 65536.
_MOST_STEPS = FRAMES * 65536
# Runs go on for this much longer than linear theory needs to show them at rest, or apart.
_MARGIN = 1.25
_ROUND_TO = 500

Progress = Callable[[str, float], None]


@dataclasses.dataclass(frozen=True)
class Run:
    """One setting of a rope and a stepper; several figures may show the same.

    Arguments:
        family: what runs side by side have in common: kind of rope, its nodes, the stepper,
            steps per frame and frames.
        damping: damping coefficient.
    """

    family: tuple[str, int, str, int, int]
    damping: float

    @property
    def steps(self) -> int:
        """The steps that it takes."""
        *_, steps_per_frame, frames = self.family
        return steps_per_frame * frames


@dataclasses.dataclass(frozen=True, eq=False)
class Finished:
    """A run, once for each mirror image of the rope.

    Arguments:
        images: a trajectory for each of `ENDS`.
    """

    images: tuple[Trajectory, ...]

    @property
    def mirrored(self) -> bool:
        """Whether the images are each other's mirror image, to the last bit."""
        left, right = (image.states for image in self.images)
        across = np.array([-1.0, 1.0])[:, None]
        return np.array_equal(left * across, right, equal_nan=True)


def growth_of(figure: Figure, meaning: Meaning) -> Growth:
    """What linear theory says of a figure's rope when it hangs still."""
    assert figure.run_as is not None
    return growth_per_frame(
        figure.problem(meaning, ENDS[0], 1), figure.run_as, figure.steps_per_frame
    )


def frames_for(figure: Figure, growths: Iterable[Growth]) -> int:
    """How long a figure is watched: 4000 frames, or longer where theory needs it.

    That is where its slowest mode takes longer than that to decay, or an instability to grow
    out of rounding, and neither 20 000 frames nor the steps of the longest figures are
    exceeded.

    Arguments:
        figure: the figure.
        growths: for each of its meanings.
    """
    needed = [FRAMES]
    for growth in growths:
        if growth.predicted_blow_up is not None:
            needed.append(growth.predicted_blow_up)
        elif growth.rate < -growth.tolerance:
            needed.append(-np.log(DEFAULTS.speed) / -growth.rate)
    frames = _ROUND_TO * int(np.ceil(_MARGIN * max(needed[1:], default=0) / _ROUND_TO))
    most = max(FRAMES, min(MOST_FRAMES, _MOST_STEPS // figure.steps_per_frame))
    return min(max(frames, FRAMES), most)


def run_of(figure: Figure, meaning: Meaning, frames: int) -> Run:
    """The run that a figure shows."""
    assert figure.run_as is not None
    kind = "inextensible-rope" if figure.stepper == "constraint_verlet" else "rope"
    family = (kind, figure.num_nodes, figure.run_as, figure.steps_per_frame, frames)
    return Run(family, 0.0 if meaning == "listing" else figure.damping)


def run_all(
    wanted: dict[Run, Callable[[Sequence[float]], Problem]],
    folder: Path | None,
    progress: Progress,
) -> dict[Run, Finished]:
    """Make runs, those of one family side by side, and families on all cores.

    Arguments:
        wanted: for each run, what makes its problem from one of `ENDS`.
        folder: where finished runs are kept and looked for; None keeps nothing.
        progress: called with what has been finished and the fraction of steps that is done.
    """
    families: dict[tuple, list[Run]] = {}
    for run in wanted:
        families.setdefault(run.family, []).append(run)
    # The longest first, so that no core is left with it at the end.
    order = sorted(families.values(), key=lambda runs: -len(runs) * runs[0].steps)
    total = sum(run.steps for run in wanted)
    shares = dict.fromkeys(families, 0.0)
    lock = threading.Lock()

    def make(runs: list[Run]) -> dict[Run, Finished]:
        family = runs[0].family
        *_, name, steps, _ = family

        def seen(fraction: float) -> None:
            with lock:
                shares[family] = fraction * sum(run.steps for run in runs)
                progress(f"{name}: {steps} steps per frame", sum(shares.values()) / total)

        found = _made(runs, wanted, folder, seen)
        seen(1.0)
        return found

    with threads(cores()) as pool:
        parts = list(pool.map(make, order))
    return {run: finished for part in parts for run, finished in part.items()}


def _made(
    runs: list[Run],
    wanted: dict[Run, Callable[[Sequence[float]], Problem]],
    folder: Path | None,
    progress: Callable[[float], None],
) -> dict[Run, Finished]:
    """The runs of one family: read where they are kept, computed where not."""
    *_, name, steps, _ = runs[0].family
    problems = {run: [wanted[run](end) for end in ENDS] for run in runs}
    found = {
        run: kept
        for run in runs
        if folder and (kept := _read(_file(folder, run), problems[run], name, steps))
    }
    missing = [run for run in runs if run not in found]
    if missing:
        trajectories = iter(
            simulate(
                Ensemble.of([problem for run in missing for problem in problems[run]]),
                name,
                steps,
                progress=lambda _, fraction: progress(fraction or 0.0),
            )
        )
        for run in missing:
            found[run] = Finished(tuple(next(trajectories) for _ in ENDS))
            if folder:
                # What cannot be kept is only not there to go on from.
                with contextlib.suppress(InputError, OSError):
                    _keep(_file(folder, run), found[run])
    return found


def _file(folder: Path, run: Run) -> Path:
    name = json.dumps([*run.family, run.damping])
    return folder / f"{hashlib.sha256(name.encode()).hexdigest()[:20]}.npz"


def code_fingerprint() -> str:
    """What runs depend on besides their settings: the code and what it is built on."""
    digest = hashlib.sha256()
    package = Path(__file__).parents[1]
    for path in sorted(package.rglob("*.py")):
        digest.update(path.relative_to(package).as_posix().encode() + path.read_bytes())
    for name in ("jax", "jaxlib", "numpy"):
        digest.update(metadata.version(name).encode())
    return digest.hexdigest()[:20]


def _keep(path: Path, finished: Finished) -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    contents = io.BytesIO()
    np.savez(
        contents,
        allow_pickle=False,
        diverged_at=[-1 if run.diverged_at is None else run.diverged_at for run in finished.images],
        **{f"states{image}": run.states for image, run in enumerate(finished.images)},
    )
    write_whole(path, contents.getvalue())


def _read(path: Path, problems: Sequence[Problem], name: str, steps: int) -> Finished | None:
    """A run that was kept; None where there is none that can be read whole."""
    try:
        # From memory: a damaged file would not be closed.
        with np.load(io.BytesIO(path.read_bytes()), allow_pickle=False) as kept:
            diverged = [None if at < 0 else int(at) for at in kept["diverged_at"]]
            states = [kept[f"states{image}"] for image in range(len(problems))]
    except (OSError, ValueError, KeyError, EOFError, zipfile.BadZipFile, zlib.error):
        return None
    return Finished(
        tuple(
            Trajectory(
                problem=problem,
                stepper=as_stepper(name),
                steps_per_frame=steps,
                times=problem.ts[: len(own)],
                states=own,
                status="ok" if at is None else "diverged",
                diverged_at=at,
                rhs_evaluations=0,
                seconds=0.0,
                compile_seconds=0.0,
            )
            for problem, own, at in zip(problems, states, diverged, strict=True)
        )
    )
