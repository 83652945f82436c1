"""What `ropeode check FOLDER` asks of every submission: a stepper."""

from __future__ import annotations

import dataclasses
import hashlib
import os
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from ropeode.checking import (
    CheckReport,
    Claims,
    Examination,
    check_stepper,
    chosen_checks,
    cut_off,
    generic,
    kept_output,
    undamped,
    within,
)
from ropeode.classroom.examination import Asked
from ropeode.errors import RopeodeError
from ropeode.precision import in_float64
from ropeode.problems import keep_apart
from ropeode.sandbox import MEBIBYTE, Limits
from ropeode.steppers import Stepper, as_stepper

# Steps that tell whether two submissions behave alike.
_STEPS, _SEED = 24, 20


@dataclasses.dataclass(frozen=True)
class Steppers(Asked):
    """A check of each stepper.

    Arguments:
        check: the arguments of `check_stepper`.
    """

    check: Mapping[str, Any]

    refused = "no stepper"
    ahead = (
        "ropeode.bars",
        "ropeode.checking.diagnosis.stepper",
        "ropeode.references.consensus",
        "ropeode.simulation.driver",
        "ropeode.simulation.kernel_fusion",
        "ropeode.simulation.transposes",
        "ropeode.steppers.scipy_solvers",
    )

    @property
    def limits(self) -> Limits:
        """Of the time, ropeode needs a part itself."""
        each = self.check["time_limit"]
        return Limits(20.0 + 6.0 * each, 60.0 + 10.0 * each, self.memory_mib * MEBIBYTE)

    def report(
        self, where: Sequence[str], folder: Path, scratch: Path, say: Callable[[str], None]
    ) -> tuple[CheckReport, str]:
        """The report of `check_stepper`, and a digest of single steps."""
        (place,) = where
        if "/" in place:
            # What stands beside it in its own subfolder can be read, and imported.
            os.chdir((folder / place.rpartition(".py")[0]).parent)
        else:
            keep_apart(folder)
        say("the import")
        with kept_output():
            stepper = as_stepper(place, folder=folder)
        report = check_stepper(stepper, **self.check, progress=lambda text, _: say(text))
        say("a comparison with others")
        return report, _behaviour(stepper, self.check["time_limit"])

    def cut_off(self, where: Sequence[str], how: str, during: str) -> CheckReport:
        """It is wrong: a step returns."""
        claims = {each.name: self.check.get(each.name) for each in dataclasses.fields(Claims)}
        claims["order"] = self.check["expected_order"]
        names = chosen_checks(self.check["only"], self.check["skip"], self.check["quick"])
        return cut_off(where[0], Claims(**claims), names, how, during)


def _behaviour(stepper: Stepper, limit: float) -> str:
    """A digest of single steps from fixed random states; empty where a step is not repeatable."""
    examination = Examination(stepper)

    @in_float64
    def steps() -> str:
        random, digest = np.random.default_rng(_SEED), hashlib.sha256()
        for number in range(_STEPS):
            rope = examination.told(generic() if number % 2 else undamped())
            free = rope.args.free[:, None]
            still = np.stack([np.ones_like(free), free])
            moved = rope.y0 + 0.3 * still * random.standard_normal(rope.y0.shape)
            dt = float(random.uniform(0.001, 0.1))
            digest.update(examination.one_step(rope.changed(y0=moved), dt).tobytes())
        return digest.hexdigest()

    try:
        with kept_output():
            once, again = (within(limit, "a comparison with others", steps) for _ in range(2))
    except RopeodeError:
        return ""
    return once if once == again else ""
