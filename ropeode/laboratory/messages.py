"""What goes between the page and Python: the one definition of it.

The page sends the whole list of what it wants now, the most urgent first. Whatever is no longer on
the list is dropped. Each answer depends on its question alone and is sent once for each key. Arrays
follow the JSON of an answer as float32 (`wire.py`).
"""

from __future__ import annotations

from typing import Annotated, Any, Literal

from pydantic import BaseModel, ConfigDict, Field

MOST_WANTED = 64
LONGEST_KEY = 4096
LONGEST_NAME = 200

Name = Annotated[str, Field(max_length=LONGEST_NAME)]
Steps = Annotated[int, Field(ge=1, le=2**20)]
# Steps per frame whose runs are in the order plot, and steppers that are shown at once.
Ladder = Annotated[tuple[Steps, ...], Field(min_length=1, max_length=32)]
Shown = Annotated[tuple[Name, ...], Field(max_length=5)]


class Message(BaseModel):
    """Base of all messages: immutable, unknown fields refused."""

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)


class ProblemChoice(Message):
    """A problem of the library (or the one that the lab was opened with) and its parameters."""

    name: Name = "rope"
    parameters: dict[Name, Any] = {}
    frames: Annotated[int, Field(ge=1)] = 40


# ---- questions


class AskLibrary(Message):
    """What can be chosen."""

    kind: Literal["library"]


class AskTruth(Message):
    """The certified reference."""

    kind: Literal["truth"]
    problem: ProblemChoice


class OfStepper(Message):
    """Base of questions about one stepper on a problem.

    `version` is the hash of the user's file, for a stepper of the user's own.
    """

    problem: ProblemChoice
    stepper: Name
    version: Name | None = None


class AskRun(OfStepper):
    """One run of a stepper, beside the reference."""

    kind: Literal["run"]
    steps_per_frame: Steps


class AskOrder(OfStepper):
    """The observed order from runs with these steps per frame."""

    kind: Literal["order"]
    steps_per_frame: Ladder


class AskTheory(OfStepper):
    """What theory predicts of the error as the step size goes to zero."""

    kind: Literal["theory"]


class AskStability(OfStepper):
    """The stability region of a stepper, and the problem's eigenvalues."""

    kind: Literal["stability"]


class AskPhase(Message):
    """Position and velocity of one component of a node, or of a mode, along the reference and runs.

    `mode` counts from the slowest; it is for ropes.
    """

    kind: Literal["phase"]
    problem: ProblemChoice
    stepper: Name | None = None
    steps_per_frame: Steps | None = None
    version: Name | None = None
    node: Annotated[int, Field(ge=0)] | None = None
    component: Annotated[int, Field(ge=0)] = 0
    mode: Annotated[int, Field(ge=0)] | None = None


class AskCheck(Message):
    """The verdict of `ropeode check` on a stepper; `quick` leaves out what takes long."""

    kind: Literal["check"]
    stepper: Name
    quick: bool = False
    version: Name | None = None


class GivenFile(Message):
    """A file of trajectories that was dropped on the page."""

    name: Name
    text: str


class AskGrade(Message):
    """The verdict of `ropeode grade` on CSV files, and their trajectories."""

    kind: Literal["grade"]
    problem: ProblemChoice
    files: Annotated[tuple[GivenFile, ...], Field(min_length=1, max_length=32)]


class AskCommand(Message):
    """The command, and the Python code, that compute what the page shows."""

    kind: Literal["command"]
    problem: ProblemChoice
    steppers: Shown
    steps_per_frame: Ladder


class AskFilm(Message):
    """The same as a GIF."""

    kind: Literal["film"]
    problem: ProblemChoice
    steppers: Annotated[Shown, Field(min_length=1)]
    steps_per_frame: Steps
    version: Name | None = None


Ask = Annotated[
    AskLibrary
    | AskTruth
    | AskRun
    | AskOrder
    | AskTheory
    | AskStability
    | AskPhase
    | AskCheck
    | AskGrade
    | AskCommand
    | AskFilm,
    Field(discriminator="kind"),
]


class Wanted(Message):
    """A question, with the key that its answer carries."""

    key: Annotated[str, Field(max_length=LONGEST_KEY)]
    ask: Ask


class Want(Message):
    """Everything that the page wants now, the most urgent first."""

    want: Annotated[tuple[Wanted, ...], Field(max_length=MOST_WANTED)]


# ---- answers. A field whose comment says (a, b) is an array: its name is in the header's `arrays`.


class ParameterFacts(Message):
    """A parameter of a problem, as its control shows it."""

    name: str
    default: Any
    # What is allowed, in words.
    allowed: str
    whole: bool
    # Ends of the slider; every allowed number can be typed.
    low: float | None
    high: float | None
    # Whether the slider moves in powers of ten.
    logarithmic: bool
    unit: str
    # What it is, in a few words.
    words: str


class ProblemFacts(Message):
    """A problem that can be chosen."""

    name: str
    # One line.
    words: str
    parameters: tuple[ParameterFacts, ...]
    frames: int
    most_frames: int
    # Steppers that can run on it, and those that a newcomer sees first.
    steppers: tuple[str, ...]
    default_steppers: tuple[str, ...]


class StepperFacts(Message):
    """A stepper that can be chosen, with its options (name to values, the first is the default)."""

    name: str
    family: str
    options: dict[str, tuple[str, ...]]


class OwnStepper(Message):
    """A stepper from the file that the lab was opened with."""

    name: str
    # Hash of the file's text; None while there is no version that works.
    version: str | None
    # Why the newest text cannot be used, and on which line; None if it can.
    fault: str | None
    line: int | None


class SceneState(Message):
    """What a scene sets of the page's state."""

    problem: ProblemChoice
    steppers: Shown
    # The last is the one that is played.
    ladder: Ladder
    plot: Literal["error", "energy", "phase", "order", "stability"]


class SceneFacts(Message):
    """A lesson, or a figure of the published report; texts by language ("en", "zh")."""

    name: Name
    title: dict[str, str]
    # Three sentences, a line each.
    text: dict[str, str]
    # The page of the documentation that tells more, without its suffix.
    page: str
    state: SceneState


class Library(Message):
    """Answer to `library`."""

    kind: Literal["library"] = "library"
    problems: tuple[ProblemFacts, ...]
    steppers: tuple[StepperFacts, ...]
    own: tuple[OwnStepper, ...]
    scenes: tuple[SceneFacts, ...]


class Truth(Message):
    """Answer to `truth`. Samples are ``samples_per_frame`` in each frame.

    Arrays: times (samples,); points (samples, points, 2): what is drawn; bound (trusted,): of the
    error; energy and energy_bound (known,): the true energy at the first samples and how far it
    may be wrong, where the problem has one.
    """

    kind: Literal["truth"] = "truth"
    # One line that names the problem.
    words: str
    frame: float
    frames: int
    samples_per_frame: int
    # Samples up to the trust horizon, and its time; None if the reference is trusted to the end.
    trusted: int
    horizon: float | None
    norm: str
    # How it is drawn, which points are joined, and which are fixed.
    drawing: Literal["rope", "pendulum", "orbit", "phase"]
    links: tuple[tuple[int, int], ...]
    fixed: tuple[int, ...]
    # The node that each point is; None for a pivot, a wall, a sun, or the point of a phase plane.
    nodes: tuple[int | None, ...]
    # Names of the axes of what is drawn; units of time and of energy, empty where they have none.
    axes: tuple[str, str]
    time_unit: str
    energy_unit: str
    # The certificate, as lines of text.
    certificate: tuple[str, ...]


class Run(Message):
    """Answer to `run`. Its samples are every ``every``-th of the reference's.

    Arrays: differences (samples, points, 2) of what is drawn from the reference, up to the last
    finite sample; errors (trusted,): in the problem's norm, at the samples that are trusted;
    energy_differences (known,) from the true energy, where there is one. The
    largest error is that of `ropeode table`, at the frames.
    """

    kind: Literal["run"] = "run"
    # Its name with options, or that of a file; files have no steps per frame and no seconds.
    stepper: str
    steps_per_frame: int | None = None
    dt: float
    every: int
    status: Literal["ok", "diverged", "unsolved"]
    diverged_at: int | None = None
    error_max: float | None
    resolution: float
    rhs_evaluations: int | None = None
    seconds: float | None = None


class LeftOutPoint(Message):
    """A point that the fit leaves out, and why."""

    steps_per_frame: int
    why: str


class Order(Message):
    """Answer to `order`: the verdict in the words of `ropeode table`."""

    kind: Literal["order"] = "order"
    stepper: str
    observed: float | None
    low: float | None
    high: float | None
    verdict: str
    # One sentence.
    words: str
    used: tuple[int, ...]
    left_out: tuple[LeftOutPoint, ...]
    # The fitted line: error = constant * dt**observed.
    constant: float | None


class Theory(Message):
    """Answer to `theory`: error_max = constant * dt**order near dt = 0, or why there is none."""

    kind: Literal["theory"] = "theory"
    stepper: str
    order: int | None = None
    constant: float | None = None
    words: str


class Stability(Message):
    """Answer to `stability`.

    Arrays: radius (rows, columns), of the stability function over the box, from below and from
    the left; times (times,); eigenvalues (times, values, 2): real and imaginary, of the right-hand
    side along the reference.
    """

    kind: Literal["stability"] = "stability"
    stepper: str
    real: tuple[float, float] | None = None
    imaginary: tuple[float, float] | None = None
    # Why there is no region; the largest stable dt, and one sentence.
    why_none: str | None = None
    largest_stable_dt: float | None = None
    words: str


class Phase(Message):
    """Answer to `phase`. Arrays: x (samples,), v (samples,). `every` as in `Run`."""

    kind: Literal["phase"] = "phase"
    every: int
    x_label: str
    v_label: str


class Line(Message):
    """A line of a report: what kind of line it is, and its text.

    Kinds: "title"; the status of a finding, "pass", "fail", "undetermined", "note" or "skip";
    "diagnosis"; and the verdict, "right", "wrong" or "undetermined", in the second line where
    all checks are made.
    """

    status: str
    text: str


class Checked(Message):
    """Answer to `check`: the lines of `ropeode check`.

    Where `quick` has left out some of all the checks, no line is a verdict.
    """

    kind: Literal["check"] = "check"
    stepper: str
    made: int
    checks: int
    lines: tuple[Line, ...]


class Graded(Message):
    """Answer to `grade`: the lines of `ropeode grade`, and runs like those of steppers.

    Arrays: those of each run, with its number before the name: "0.differences".
    """

    kind: Literal["grade"] = "grade"
    lines: tuple[Line, ...]
    runs: tuple[Run, ...]


class Command(Message):
    """Answer to `command`."""

    kind: Literal["command"] = "command"
    # None for a problem with parameters that the command line cannot set.
    command: str | None
    python: str


class FilmFile(Message):
    """Answer to `film`: the GIF, in base64."""

    kind: Literal["film"] = "film"
    gif: str


class Refused(Message):
    """Answer to a question that has none: a sentence that names the field, and how to mend it."""

    kind: Literal["refused"] = "refused"
    message: str
    # Of the user's file, where its code raised.
    line: int | None = None


class Working(Message):
    """What is being computed."""

    kind: Literal["working"] = "working"
    key: str
    text: str


class Reloaded(Message):
    """The user's file has changed: ask for the library again."""

    kind: Literal["reloaded"] = "reloaded"
    own: tuple[OwnStepper, ...]
