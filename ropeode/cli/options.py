"""The options of `ropeode table`, named as the fields that they set, and the job that they make."""

from __future__ import annotations

import os
from collections.abc import Callable, Collection, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import click

from ropeode.files import NO_CODE, check_writable
from ropeode.terminal import CommaSeparated, check_folder, split_at_commas
from ropeode.validation import bad_value, check_positive

if TYPE_CHECKING:
    from ropeode.study import TableJob


def _one_or_list(value: str) -> Any:
    return split_at_commas(value) if "," in value else value


def _rows(value: str) -> Any:
    rows = [split_at_commas(row) for row in value.split(";")]
    return rows if len(rows) > 1 else rows[0]


def split_methods(value: str) -> list[str]:
    """Split at commas, except at those between the options of one stepper."""
    found: list[str] = []
    for part in split_at_commas(value):
        if found and "=" in part and ":" not in part:
            found[-1] += f",{part}"
        else:
            found.append(part)
    return found


class Option(NamedTuple):
    """An option that sets a field of a spec.

    Fields:
        read: turns its text into the field's value, which is not checked yet.
        metavar: how it is written.
        help: what it means.
        type: tells the shell what completes it.
    """

    read: Callable[[str], Any]
    metavar: str
    help: str
    type: click.ParamType = click.STRING


# By field of Rope.
ROPE = {
    "start": Option(split_at_commas, "X,Y[,Z]", "Position of the first node. [0,200]"),
    "end": Option(split_at_commas, "X,Y[,Z]", "Position of the last node. [-400,200]"),
    "num_nodes": Option(str, "N", "Number of nodes. [16]"),
    "node_mass": Option(_one_or_list, "M[,M...]", "Mass: one number, or one per node. [1]"),
    "stiffness": Option(
        _one_or_list, "K[,K...]", "Stiffness: one number, or one per spring. [100]"
    ),
    "pinned": Option(split_at_commas, "I[,I...]", "Nodes that do not move; '' for none. [0]"),
    "gravity": Option(split_at_commas, "X,Y[,Z]", "Acceleration of gravity. [0,-1]"),
    "damping": Option(_one_or_list, "D[,D...]", "Damping: one number, or one per node. [0.01]"),
    "initial_velocity": Option(
        _rows, "X,Y[;X,Y...]", "Velocity of all free nodes, or per node. [0,0]"
    ),
}

# By field of TableSpec.
TABLE = {
    "problem": Option(
        str,
        "NAME",
        "rope, another library problem, FILE.py:NAME or SPEC.toml. [rope]",
        click.Path(),
    ),
    "kind": Option(str, "KIND", "rope (springs) or inextensible-rope (rigid links). [rope]"),
    "reference": Option(
        str,
        "FILE",
        "A reference file, or a name in the stored library. It sets the problem too.",
        click.Path(),
    ),
    "frames": Option(str, "N", "Number of frames to solve. [20]"),
    "steppers": Option(
        split_methods,
        "S[,S...]",
        "Names (`ropeode steppers` lists them), FILE.py:NAME, runge-kutta:FILE.toml, "
        "diffrax:NAME, scipy:NAME.",
    ),
    "steps_per_frame": Option(split_at_commas, "N[,N...]", "Steps per frame. [16,32,...,16384]"),
    "norm": Option(str, "NAME", "Measure of errors: position-max, position-rms, ..."),
    "accuracy": Option(str, "E", "Largest error bound to trust. [1e-8 of the motion]"),
    "rtol": Option(str, "R", "Tolerance of the reference. [the tightest useful one]"),
    "level": Option(str, "LEVEL", "Of the reference: consensus or extended. [consensus]"),
    "digits": Option(str, "N", "Digits of an extended reference. [18]"),
    "time_limit": Option(str, "S", "Seconds that the runs of the reference may take. [60]"),
}

# Fields whose option has a shorter name.
_SHORT = {"steps_per_frame": "steps"}


# Of commands that read trajectories.
dt_option = click.option(
    "--dt",
    metavar="A[,B...]",
    type=CommaSeparated(),
    help="Step size of each file. [as the files say, or the steps per frame in their names]",
)


# Of commands that compare runs with theory.
predict_option = click.option(
    "--predict/--no-predict",
    default=None,
    help="Predict the errors of all steppers, however long it takes, or of none. [of those in "
    "--steppers, while it takes no longer than their runs]",
)


def _allow_no_code(ctx: click.Context, param: click.Parameter, chosen: bool) -> None:
    if chosen:
        os.environ[NO_CODE] = "1"


# Of commands that take specs, and names of problems and steppers.
no_code_option = click.option(
    "--no-code",
    is_flag=True,
    expose_value=False,
    callback=_allow_no_code,
    help="Refuse FILE.py, and specs that name one.",
)


# What only runs of steppers depend on, not a problem or its reference.
OF_RUNS = ("steppers", "steps_per_frame", "norm")


OUT_OF_CLASSES = "Write the report to FILE; of a FOLDER the grade book to DIR, which resumes."
# Of commands that take a FOLDER of submissions.
_OF_CLASSES = (
    click.option(
        "--memory",
        metavar="MIB",
        help="Of a FOLDER: memory that a submission may hold, in MiB. [2048]",
    ),
    click.option(
        "--rubric",
        metavar="FILE.toml",
        type=click.Path(path_type=Path),
        help="Of a FOLDER: how many points for which checks.",
    ),
)


def class_options(function: Callable) -> Callable:
    """Add the options that a FOLDER of submissions has."""
    for option in reversed(_OF_CLASSES):
        function = option(function)
    return function


def class_folder(named: str | Path | None, **of_classes: Any) -> Path | None:
    """The FOLDER of submissions that was named; None if it is something else.

    Arguments:
        named: what the command is about.
        of_classes: options that only a FOLDER has, None where they were not given.

    Raises:
        InputError: one was given without a FOLDER.
    """
    if named is not None and os.path.isdir(named):
        return Path(named)
    for option, given in of_classes.items():
        if given is not None:
            fix = "leave it out, or name a folder"
            raise bad_value(option, str(given), "none but with a FOLDER of submissions", fix)
    return None


def class_output(out: str | None, folder: Path | None) -> Path | None:
    """The path of --out: a folder for a FOLDER of submissions, else a file.

    Raises:
        InputError: it cannot be written to.
    """
    if out is None:
        return None
    return check_writable("out", out) if folder is None else check_folder("out", out)


def memory_limit(given: str | None) -> float:
    """The memory that a submission may hold, in MiB.

    Raises:
        InputError: it is no positive number.
    """
    return check_positive("memory", given or "2048", example="2048")


def table_options(without: Collection[str] = ()) -> Callable[[Callable], Callable]:
    """Add an option for each field of a table's spec and of the rope.

    Arguments:
        without: the fields that a command has no use for.
    """

    def add(function: Callable) -> Callable:
        for prefix, options in (("rope_", ROPE), ("", TABLE)):
            for field, option in reversed(options.items()):
                if field not in without:
                    name = f"--{_SHORT.get(field, field).replace('_', '-')}"
                    add_one = click.option(
                        name,
                        prefix + field,
                        metavar=option.metavar,
                        help=option.help,
                        type=option.type,
                    )
                    function = add_one(function)
        return no_code_option(function)

    return add


def job_from(spec: Path | None, options: Mapping[str, Any]) -> TableJob:
    """The job that a spec file and options describe; options override the file.

    Arguments and errors are those of `values_from`.
    """
    from ropeode.study import TableJob

    return TableJob(*values_from(spec, options))


def values_from(
    spec: Path | None, options: Mapping[str, Any]
) -> tuple[dict[str, Any], Path | None]:
    """The values of a spec file and of options, and the folder that names of files start from.

    Arguments:
        spec: the file, or None; the problem may name one then.
        options: what was typed, by the names that click has for the options of `table_options`.

    Raises:
        InputError: one line for each value that cannot be used.
    """
    from ropeode.study import read_spec

    def read(fields: Mapping[str, Option], prefix: str) -> dict[str, Any]:
        return {
            field: option.read(text)
            for field, option in fields.items()
            if (text := options.get(prefix + field)) is not None
        }

    given, rope = read(TABLE, ""), read(ROPE, "rope_")
    if not spec and given.get("problem", "").endswith(".toml"):
        spec = Path(given.pop("problem"))
    values: dict[str, Any] = read_spec(spec) if spec else {}
    if "reference" in given and os.path.exists(given["reference"]):
        # Relative to the current folder, not to that of the spec.
        given["reference"] = str(Path(given["reference"]).resolve())
    values |= given
    if rope and isinstance(values.setdefault("rope", {}), dict):
        values["rope"] |= rope
    return values, None if "problem" in given or not spec else spec.parent
