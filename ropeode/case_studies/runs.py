"""The runs behind the figures: they run side by side, and stay on disk until the report is done."""

from __future__ import annotations

import contextlib
import dataclasses
import functools
import hashlib
import io
import math
import threading
import zipfile
import zlib
from collections.abc import Iterable
from importlib import metadata
from pathlib import Path
from typing import NamedTuple

import numpy as np

from ropeode.analysis import DEFAULT_THRESHOLDS
from ropeode.cache import source_digest
from ropeode.case_studies.claims import MARGIN
from ropeode.case_studies.figures import ENDS, Setting
from ropeode.errors import InputError
from ropeode.files import write_whole
from ropeode.problems import Ensemble, Problem
from ropeode.progress import Progress, silent
from ropeode.simulation import Trajectory, simulate
from ropeode.steppers import as_stepper
from ropeode.theory import Growth, growth_per_frame, stability_limit
from ropeode.threads import cores, threads
from ropeode.validation import counted

FRAMES = 4000
MOST_FRAMES = 20_000
# No run takes more steps than 4000 frames of 65536.
_MOST_STEPS = FRAMES * 65536
_ROUND_TO = 500


class Run(NamedTuple):
    """A setting over a number of frames."""

    setting: Setting
    frames: int

    @property
    def steps(self) -> int:
        """The steps that it takes."""
        return self.setting.steps_per_frame * self.frames

    @property
    def family(self) -> Run:
        """What runs that can go side by side have in common: all but the damping."""
        return self._replace(setting=dataclasses.replace(self.setting, damping=0.0))


class Images(NamedTuple):
    """The trajectories of one run.

    Fields:
        left: of the rope that is drawn to the left.
        right: of its mirror image.
        nudged: of the rope to the left with the last digits of its initial positions changed.
    """

    left: Trajectory
    right: Trajectory
    nudged: Trajectory

    @property
    def mirrored(self) -> bool:
        """Whether left and right are each other's mirror image, to the last bit."""
        across = np.array([-1.0, 1.0])[:, None]
        return np.array_equal(self.left.states * across, self.right.states, equal_nan=True)


def problems_of(run: Run) -> list[Problem]:
    """The problems of the fields of `Images`, in their order."""
    left, right = (run.setting.problem(end, run.frames) for end in ENDS)
    y0 = left.y0.copy()
    # Up and down in turn, so that the rope as a whole is neither moved nor stretched.
    up_and_down = np.where(np.arange(y0.shape[2] - 1) % 2, np.inf, -np.inf)
    y0[0, :, 1:] = np.nextafter(y0[0, :, 1:], up_and_down)
    return [left, right, left.changed(y0=y0)]


@functools.cache
def growth_of(setting: Setting) -> Growth:
    """What linear theory says of a setting's rope when it hangs still."""
    return growth_per_frame(setting.problem(ENDS[0], 1), setting.stepper, setting.steps_per_frame)


def stable_from(setting: Setting) -> int | None:
    """Steps per frame from which on a rope hangs still by linear theory; None: there are none."""
    return _stable_from(dataclasses.replace(setting, steps_per_frame=1))


@functools.cache
def _stable_from(setting: Setting) -> int | None:
    return stability_limit(setting.problem(ENDS[0], 1), setting.stepper)


def frames_for(settings: Iterable[Setting]) -> int:
    """How long the settings of a figure are watched: 4000 frames, or longer.

    Longer where the slowest mode takes longer than that to decay, or an instability to grow
    out of rounding; but neither for more than 20 000 frames nor for more steps than the
    longest figures take.
    """
    needed, most = [0.0], MOST_FRAMES
    for setting in settings:
        growth = growth_of(setting)
        if growth.predicted_blow_up is not None:
            needed.append(growth.predicted_blow_up)
        elif growth.rate < -growth.tolerance:
            needed.append(-np.log(DEFAULT_THRESHOLDS.speed) / -growth.rate)
        most = min(most, _MOST_STEPS // setting.steps_per_frame)
    frames = _ROUND_TO * int(np.ceil(MARGIN * max(needed) / _ROUND_TO))
    return max(FRAMES, min(frames, most))


def run_all(
    runs: Iterable[Run], folder: Path | None, progress: Progress = silent
) -> dict[Run, Images]:
    """Make runs, those of one family side by side, and families on all cores.

    Arguments:
        runs: each once.
        folder: where finished runs are kept and looked for; None keeps nothing.
        progress: called with what has been finished and the fraction of steps that is done.
    """
    families: dict[Run, list[Run]] = {}
    for run in runs:
        families.setdefault(run.family, []).append(run)
    # The longest first, so that no core is left with it at the end.
    longest_first = sorted(families.values(), key=lambda runs: -sum(run.steps for run in runs))
    total = sum(run.steps for runs in families.values() for run in runs)
    shares = dict.fromkeys(families, 0.0)
    lock = threading.Lock()

    def images_of(runs: list[Run]) -> dict[Run, Images]:
        family = runs[0].family

        def report(text: str, fraction: float | None) -> None:
            with lock:
                shares[family] = (fraction or 0.0) * sum(run.steps for run in runs)
                progress(text, sum(shares.values()) / total)

        return _read_or_run(runs, folder, report)

    with threads(cores()) as pool:
        parts = list(pool.map(images_of, longest_first))
    return {run: images for part in parts for run, images in part.items()}


def _read_or_run(runs: list[Run], folder: Path | None, progress: Progress) -> dict[Run, Images]:
    """The runs of one family: read where they are kept, computed where not."""
    setting = runs[0].setting
    text = f"{setting.stepper}: {counted(setting.steps_per_frame, 'step')} per frame"
    done = {run: kept for run in runs if folder and (kept := _read(_file(folder, run), run))}
    missing = [run for run in runs if run not in done]
    if missing:
        trajectories = iter(
            simulate(
                Ensemble.of([problem for run in missing for problem in problems_of(run)]),
                setting.stepper,
                setting.steps_per_frame,
                # They end: the number of their steps is known.
                time_limit=math.inf,
                progress=lambda _, fraction: progress(text, fraction),
            )
        )
        for run in missing:
            done[run] = Images(*(next(trajectories) for _ in Images._fields))
            if folder:
                # Where a run cannot be kept, an interrupted report computes it again.
                with contextlib.suppress(InputError, OSError):
                    _keep(_file(folder, run), done[run])
    progress(text, 1.0)
    return done


def _file(folder: Path, run: Run) -> Path:
    return folder / f"{hashlib.sha256(repr(run).encode()).hexdigest()[:20]}.npz"


def code_fingerprint() -> str:
    """What runs depend on besides their settings: the code and what it is built on."""
    digest = hashlib.sha256(source_digest(Path(__file__).parents[1]).encode())
    for name in ("jax", "jaxlib", "numpy"):
        digest.update(metadata.version(name).encode())
    return digest.hexdigest()[:20]


def _keep(path: Path, images: Images) -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    contents = io.BytesIO()
    states = {name: trajectory.states for name, trajectory in images._asdict().items()}
    np.savez(contents, allow_pickle=False, **states)
    write_whole(path, contents.getvalue())


def _read(path: Path, run: Run) -> Images | None:
    """A run that was kept; None where there is none that can be read whole."""
    try:
        # From memory: a damaged file would not be closed.
        with np.load(io.BytesIO(path.read_bytes()), allow_pickle=False) as kept:
            states = [kept[name] for name in Images._fields]
    except (OSError, ValueError, KeyError, EOFError, zipfile.BadZipFile, zlib.error):
        return None
    return Images(
        *(
            Trajectory(
                problem=problem,
                stepper=as_stepper(run.setting.stepper),
                steps_per_frame=run.setting.steps_per_frame,
                times=problem.ts[: len(own)],
                states=own,
                status="ok" if len(own) == len(problem.ts) else "diverged",
                diverged_at=None if len(own) == len(problem.ts) else len(own),
                rhs_evaluations=0,
                jacobian_evaluations=0,
                seconds=0.0,
                compile_seconds=0.0,
            )
            for problem, own in zip(problems_of(run), states, strict=True)
        )
    )
