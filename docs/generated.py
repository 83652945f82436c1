"""The computed parts of the pages: `make docs` writes them.

Each function returns Markdown; pictures go to docs/images. The pages call the functions in comments
that the program cog executes.
"""

from __future__ import annotations

import functools
import io
import json
import math
import re
import subprocess
import sys
import textwrap
from pathlib import Path

import numpy as np
from lookup import table
from PIL import Image
from studies.falling_ropes import FPS, falling_ropes, film_of_ropes
from studies.growth import growth_scan
from studies.local_errors import local_errors, propagated
from studies.plots import (
    Besides,
    plot_besides,
    plot_growth,
    plot_local_errors,
    plot_propagated,
    plot_rest_times,
    plot_sweeps,
)
from studies.position_based import (
    NEAR,
    SHOWN,
    growth_by_jacobi,
    limits_of_graphics,
    near_implicit_euler,
)
from studies.projection_sweeps import sweep_study
from studies.rest_time import rest_times
from studies.small_step_plots import plot_cheapest, plot_damping, plot_splits
from studies.small_steps import (
    NODES,
    Spent,
    Splits,
    damping_rates,
    every_rope,
    rope_of,
    time_of_steps,
)
from studies.tension_lag import predicted_by_lag
from studies.three_verlets import plot_three_verlets, three_verlets

import ropeode
from ropeode import (
    InextensibleRope,
    Rope,
    accuracy_table,
    format_horizon,
    format_table,
    growth_per_frame,
    lyapunov_exponent,
    stability_limit,
)
from ropeode import horizon as horizon_of
from ropeode.case_studies import Report, plot_contact_sheets, rope_report
from ropeode.checking import Examination
from ropeode.errors import InputError
from ropeode.files import write_whole
from ropeode.laboratory.scenes import scenes
from ropeode.precision import in_float64
from ropeode.render import blocks, figure_bytes, markdown, plot_horizon
from ropeode.render.plots.animation import gif
from ropeode.steppers import ProblemClass, library_solvers

IMAGES = Path(__file__).parent / "images"
# Enough for lines and text, and a third of the size.
_COLOURS = 128
# Steps per frame whose errors are extrapolated to dt = 0.
LATE = (256, 512)
DAMPINGS = (0.0, 0.001, 0.01, 0.1)
GROWN = (1024, 4096, 16384, 65536)
# Pictures of the lab, as tools/scene_pictures.py puts them together.
OF_A_SHEET = 6


def picture(figure, name: str, words: str) -> str:
    """A figure as a file of docs/images, and the Markdown that shows it."""
    IMAGES.mkdir(exist_ok=True)
    image = Image.open(io.BytesIO(figure_bytes(figure, ".png"))).convert("RGB")
    small = io.BytesIO()
    image.quantize(_COLOURS).save(small, "PNG", optimize=True)
    write_whole(IMAGES / name, small.getvalue())
    return f"![{words}](../images/{name})"


def folded(summary: str, body: str) -> str:
    """Markdown that a reader opens by a click."""
    return f"<details>\n<summary>{summary}</summary>\n\n{body}\n\n</details>"


def verlets() -> str:
    """The error of three Verlets against step size."""
    words = "error against step size of three Verlets: order 1, order 2, and no order"
    return picture(plot_three_verlets(three_verlets()), "three-verlets.png", words)


def ropes() -> str:
    """A film of the reference, explicit Euler, and Verlet with damping per step."""
    write_whole(IMAGES / "falling-ropes.gif", gif(film_of_ropes(falling_ropes()), FPS))
    words = "a rope falls; explicit Euler flies apart, Verlet with damping per step hardly falls"
    return f"![{words}](../images/falling-ropes.gif)"


def limits() -> str:
    """How fast disturbances of the hanging rope grow, and from where on they do not, by damping."""
    stiffness, rows = Rope().stiffness, []
    for damping in DAMPINGS:
        problem = Rope(damping=damping).problem(1)
        rates = [growth_per_frame(problem, "explicit-euler", steps).rate for steps in GROWN]
        limits_of = [
            stability_limit(problem, name) for name in ("explicit-euler", "semi-implicit-euler")
        ]
        row = [f"{damping:g}", *(f"{rate:.5f}" for rate in rates)]
        row += ["none" if n is None else str(n) for n in limits_of]
        rows.append([*row, f"{4 * stiffness / damping:.0f}" if damping else "none"])
    headers = ["damping", *(f"at {steps}" for steps in GROWN)]
    return table([*headers, "limit", "limit, semi-implicit Euler", "4k/c"], rows)


def growth() -> str:
    """Predicted and measured growth rates, and their picture."""
    scan = growth_scan()
    rows = [
        [
            each.stepper,
            str(each.steps_per_frame),
            f"{each.predicted:.5f}",
            f"{each.measured:.5f}",
            f"{each.measured / each.predicted - 1:+.1e}",
        ]
        for each in scan
    ]
    words = "growth rate against steps per frame"
    headers = ["stepper", "steps/frame", "predicted", "measured", "difference"]
    rates = folded("All rates, predicted and measured", table(headers, rows, words=1))
    return f"{picture(plot_growth(scan), 'growth.png', words)}\n\n{rates}"


def rests() -> str:
    """When the Verlet ropes come to rest, and the picture."""
    times = [
        each
        for rope in ("constraint", "force")
        for rule in ("per-step", "lagged")
        for each in rest_times(rope, rule)
    ]
    rows = [
        [
            {"constraint": "rigid links", "force": "springs"}[each.rope],
            {"per-step": "per step", "lagged": "per time"}[each.rule],
            str(each.steps_per_frame),
            f"{each.rate:g}",
            "-" if each.settled_at is None else str(each.settled_at),
            "-" if each.product is None else f"{each.product:.2f}",
        ]
        for each in times
    ]
    headers = ["rope", "damping", "steps/frame", "damping per frame", "at rest from", "product"]
    words = "frame of coming to rest against steps per frame"
    return "\n\n".join(
        [picture(plot_rest_times(times), "rest-time.png", words), table(headers, rows, words=2)]
    )


def late_tensions() -> str:
    """The error constant of constraint Verlet, predicted, and that of its runs as dt goes to 0."""
    rows = []
    for words, rope in {
        "the default one": InextensibleRope().problem(20),
        "5 unequal nodes, damping 0.3": InextensibleRope(
            num_nodes=5, node_mass=[1, 2, 3, 1, 2], damping=0.3
        ).problem(20),
    }.items():
        table_of = accuracy_table(rope, ["constraint-verlet", "constraint-verlet:sweeps=4"], LATE)
        predicted = predicted_by_lag(rope)
        for each in table_of.orders:
            coarse, fine = (
                row.error_max / row.dt for row in table_of.rows if row.stepper == each.stepper
            )
            limit = 2.0 * fine - coarse
            sweeps = each.stepper.partition("sweeps=")[2] or "1"
            ratio = f"{limit / predicted:.4f}"
            rows.append([words, sweeps, f"{predicted:.5g}", f"{fine:.5g}", f"{limit:.5g}", ratio])
    fine = f"error/dt at {LATE[-1]}"
    headers = ["rope", "sweeps", "predicted", fine, "in the limit", "ratio"]
    return table(headers, rows, words=1)


def sweeps() -> str:
    """Order, error constant and broken lengths for each number of sweeps, and the picture."""
    study = sweep_study()
    rows = []
    for each in study.swept:
        order, (low, high) = each.order, each.order.ci95 or (float("nan"),) * 2
        rows.append(
            [
                str(each.sweeps),
                f"{order.observed:.3f} [{low:.3f}, {high:.3f}]",
                f"{each.constant:.3f}",
                f"{each.errors[0]:.3f}",
                f"{each.errors[-1]:.3e}",
                f"{each.violations[0]:.1e}",
                f"{each.violations[-1]:.1e}",
            ]
        )
    first, last = study.swept[0].steps_per_frame[0], study.swept[0].steps_per_frame[-1]
    headers = [
        "sweeps",
        "observed order",
        "error/dt",
        f"error at {first}",
        f"error at {last}",
        f"links off at {first}",
        f"links off at {last}",
    ]
    words = "error and broken lengths against step size"
    return "\n\n".join([picture(plot_sweeps(study), "sweeps.png", words), table(headers, rows)])


def graphics_limits() -> str:
    """The rope that each graphics stepper goes to, with the order of the difference."""
    rows = []
    for each in limits_of_graphics():
        order, (low, high) = each.order, each.order.ci95 or (float("nan"),) * 2
        found = order.verdict
        if order.verdict == "converges":
            found = f"{order.observed:.2f} [{low:.2f}, {high:.2f}]"
        # What is as large as the rope is no error of a run that follows it.
        unstable = not order.used
        rows.append(
            [
                f"`{each.stepper}`",
                each.rope,
                "nothing: unstable" if unstable else each.goes_to,
                "-" if unstable else found,
                "-" if unstable else f"{each.error:.2e}",
                f"{each.own:.2e}",
            ]
        )
    headers = ["stepper", "run on", "goes to", "order", f"error at {SHOWN}", "to its own rope"]
    return table(headers, rows, words=3)


def graphics_and_euler() -> str:
    """How far graphics steppers are from implicit Euler."""
    found = near_implicit_euler(
        (
            "xpbd",
            "xpbd:iterations=5",
            "xpbd:iterations=100",
            "xpbd:sweep=jacobi",
            "projective-dynamics",
            "projective-dynamics:iterations=2",
        )
    )
    rows = [
        [f"`{stepper}`", *(f"{each:.2e}" for each in apart), f"{power:.2f}"]
        for stepper, apart, power in found
    ]
    return table(["stepper", *(f"at {steps}" for steps in NEAR), "power"], rows, words=1)


def jacobi_growth() -> str:
    """What a step of Jacobi projections multiplies the errors of lengths by."""
    rows = []
    for nodes in (3, 4, 6):
        for iterations in (1, 2, 3, 5):
            predicted, measured = growth_by_jacobi(nodes, iterations)
            found = "none" if math.isnan(measured) else f"{measured:.3f}"
            rows.append([str(nodes), str(iterations), f"{predicted:.3f}", found])
    return table(["nodes", "iterations", "predicted", "growth measured"], rows)


def single_steps() -> str:
    """The error of single steps, right and wrong ones."""
    words = "error of one step against its size"
    return picture(plot_local_errors(local_errors()), "local-errors.png", words)


def predictions() -> str:
    """Errors predicted along the default rope, and measured ones."""
    found = [
        propagated("explicit-euler", (1024, 4096, 16384)),
        propagated("velocity-verlet", (16, 32, 64)),
        propagated("stormer-verlet:start=rest", (16, 64, 256)),
    ]
    words = "predicted and measured error over time"
    return picture(plot_propagated(found), "predicted-errors.png", words)


@functools.cache
def report() -> Report:
    """The whole report, run again."""
    return rope_report()


def figures() -> str:
    """All figures of the report."""
    _, summary, figures, *_ = blocks(report())
    rows = folded("Each figure: claim, verdict and measurement", markdown([figures]).rstrip())
    return f"{markdown([summary]).rstrip()}\n\n{rows}"


@in_float64
def solver_orders(*libraries: str) -> str:
    """The documented and the observed orders of the solvers of libraries."""
    rows = []
    for given in [
        f"{library}:{name}" for library in libraries for name in library_solvers(library)
    ]:
        try:
            examination = Examination(given)
        except InputError:
            continue
        found = examination.convergence("uneven")
        shown = [
            f"{order.observed:.2f} [{order.ci95[0]:.2f}, {order.ci95[1]:.2f}]"
            for order in found.orders.values()
        ]
        rows.append([f"`{given}`", str(examination.stepper.order(ProblemClass())), *shown])
    return table(["solver", "documented", "positions", "velocities"], rows, words=1)


def comparisons() -> str:
    """The claims that compare figures."""
    return markdown([blocks(report())[3]]).rstrip()


def sensitivities() -> str:
    """The verdicts and measurements that depend on thresholds and on rounding."""
    return markdown(blocks(report())[4:]).rstrip()


def sheets() -> str:
    """Contact sheets of all figures."""
    return "\n\n".join(
        picture(sheet, f"report-{number}.png", f"figures of the report, sheet {number}")
        for number, sheet in enumerate(plot_contact_sheets(report()), start=1)
    )


SHORT, LONG = 100, 200
SPANS = (50, 100, 120, 150, 200, 300, 1000)


@functools.cache
def horizon_study(frames: int):
    """The undamped default rope, compared with extended precision."""
    return horizon_of(Rope(damping=0.0).problem(frames), SPANS, time_limit=600)


def horizon_words() -> str:
    """What the command prints, and the picture."""
    study = horizon_study(LONG)
    words = "error of every float64 run against the truth, over time"
    shown = picture(plot_horizon(study), "horizon.png", words)
    printed = folded("What the command prints", f"```text\n{format_horizon(study)}```")
    return f"{shown}\n\n{printed}"


def predicted_needs() -> str:
    """The precision that 100 frames predict for longer spans, and what these spans needed."""
    short, long = horizon_study(SHORT), horizon_study(LONG)
    rates = short.exponent.value / math.log(10), long.exponent.value / math.log(10)
    rows = []
    for need in short.needs:
        if need.measured or need.span > LONG:
            continue
        by_rate = short.digits + short.lost[-1] + rates[0] * (need.span - SHORT)
        measured = short.digits + float(np.interp(need.span, long.times, long.lost))
        low, high = need.interval
        rows.append(
            [
                f"{need.span:g}",
                f"{need.digits:.1f} [{low:.1f}, {high:.1f}]",
                str(need.bits),
                f"{measured:.1f}",
                f"{by_rate:.1f}",
            ]
        )
    headers = ["frames", "predicted digits", "bits", "measured digits", "by the exponent alone"]
    return table(headers, rows)


def agreement() -> str:
    """Digits lost up to frame 100, in two precisions."""
    short, long = horizon_study(SHORT), horizon_study(LONG)
    return table(
        ["frame", *(f"{study.truth.coarse.precision} bits" for study in (short, long))],
        [
            [f"{frame}", f"{short.lost[frame]:.2f}", f"{long.lost[frame]:.2f}"]
            for frame in (20, 40, 60, 80, 100)
        ],
    )


def growth_by_window() -> str:
    """The growth of tangents of the undamped rope, window by window."""
    exponent = lyapunov_exponent(Rope(damping=0.0).problem(2000))
    since = exponent.times - exponent.times[0]
    rows = []
    for start, end in ((0, 80), (80, 200), (200, 500), (500, 1000), (1000, 2000)):
        grown = [np.interp(at, since, exponent.log_growth.mean(axis=0)) for at in (start, end)]
        rate = (grown[1] - grown[0]) / (end - start)
        rows.append([f"{start} to {end}", f"{rate:.3f}", f"{100 * rate / math.log(10):.1f}"])
    low, high = exponent.interval
    return (
        table(["frames", "rate per frame", "digits in 100 frames"], rows)
        + f"\n\nOver the frames 1000 to 2000 the exponent is {exponent.value:.3f} [{low:.3f}, "
        f"{high:.3f}] per frame."
    )


@functools.cache
def small_steps():
    """Small steps against iterations on all ropes; several minutes, most for the references."""
    return every_rope()


def pair_of(splits: Splits, budget: int) -> tuple[Spent, Spent]:
    """All sweeps as steps, and all of them as iterations."""
    return splits.run(budget, 1), splits.run(1, budget)


def split_budgets() -> str:
    """The same sweeps as steps or as iterations: how often the steps win, and the picture."""
    found = small_steps()
    truths = [each.truth for each in found.splits.values()]
    budgets = {run.sweeps for each in found.splits.values() for run in each.runs} - {1}
    pairs = [pair_of(each, budget) for each in found.splits.values() for budget in sorted(budgets)]
    both = [(steps, iterated) for steps, iterated in pairs if steps.max and iterated.max]
    ratios = [iterated.max / steps.max for steps, iterated in both]
    stretched = sum(iterated.stretch > steps.stretch for steps, iterated in both)
    trusted = sum(each.horizon is None for each in truths)
    words = [
        f"Of {len(truths) + len(found.refused)} ropes {len(truths)} have a reference, {trusted} of "
        f"them trusted to the end; the largest bound is {max(t.bound()[-1] for t in truths):.0e} "
        f"length units. Of {len(pairs)} pairs with the same sweeps {len(both)} are resolved. With "
        f"all sweeps as steps the tip's error is smaller in {sum(r > 1 for r in ratios)}, by a "
        f"factor of {min(ratios):.2f} to {max(ratios):.0f}, {np.median(ratios):.1f} in the median. "
        f"The stretch is smaller in {stretched}. In time, 64 steps with one sweep cost "
        + ", ".join(f"{time_of_steps(rope_of(n, 1e4)):.2f} ({n} nodes)" for n in NODES)
        + " times one step with 64.",
        *(f"{n} nodes, stiffness {k:g}: {why}" for (n, k), why in found.refused.items()),
    ]
    shown = picture(
        plot_splits(found.splits),
        "small-steps.png",
        "error of the tip and stretch against sweeps per frame",
    )
    return "\n\n".join([shown, *(textwrap.fill(each, 110) for each in words)])


def split_pairs(budget: int) -> str:
    """Sweeps as steps beside the same sweeps as iterations, a line for each rope."""
    rows = []
    for (nodes, stiffness), splits in small_steps().splits.items():
        both = [split_row(nodes, stiffness, splits.stretch, run) for run in pair_of(splits, budget)]
        # The largest error of the tip, the energy and the stretch.
        cells = [row[column] for column in (4, 7, 8) for row in both]
        rows.append([*both[0][:2], *cells, both[0][-1]])
    of = [
        f"{what}, {budget} {how}"
        for what in ("tip", "energy lost", "stretch")
        for how in ("steps", "iterations")
    ]
    return table(["nodes", "stiffness", *of, "true stretch"], rows)


def split_rows(budget: int) -> str:
    """What each way to spend one number of sweeps per frame makes of each rope."""
    rows = [
        split_row(nodes, stiffness, splits.stretch, run)
        for (nodes, stiffness), splits in small_steps().splits.items()
        for run in splits.runs
        if run.sweeps == budget
    ]
    headers = ["nodes", "stiffness", "steps x iterations", "tip, final", "tip, max", "tip, rms"]
    headers += ["worst node", "energy lost", "stretch", "true stretch"]
    return table(headers, rows)


def split_row(nodes: int, stiffness: float, true_stretch: float, run: Spent) -> list[str]:
    """A line of that table; errors in percent of the rope's length."""

    def percent(part: float | None) -> str:
        return "unresolved" if part is None else f"{100 * part:.3g}%"

    head = [str(nodes), f"{stiffness:g}", f"{run.steps} x {run.iterations}"]
    if run.status != "ok":
        return [*head, run.status, *[""] * 6]
    errors = map(percent, (run.final, run.max, run.rms, run.worst))
    return [*head, *errors, f"{run.energy:+.1e}", f"{run.stretch:.1e}", f"{true_stretch:.1e}"]


def small_step_costs() -> str:
    """What each method needs for 1%: the picture, and tables of the work and of the time."""
    found = small_steps().costs
    words = "time of a frame against stiffness, for each method"
    parts = [picture(plot_cheapest(found), "small-steps-cost.png", words)]
    methods = [row.method for row in next(iter(found.values()))]
    work, times = [], []
    for (nodes, stiffness), rows in found.items():
        head = [str(nodes), f"{stiffness:g}"]
        work.append(head + [work_cell(row) for row in rows])
        best = min(row.seconds[0] for row in rows if row.seconds)
        times.append(head + [time_cell(row.seconds, best) for row in rows])
    headers, units = ["nodes", "stiffness"], [row.unit for row in next(iter(found.values()))]
    worked = [f"{method}<br>({unit})" for method, unit in zip(methods, units, strict=True)]
    parts += ["Fewest steps per frame, and in parentheses what they repeat:"]
    parts += [table([*headers, *worked], work)]
    parts += ["Time of a frame in microseconds, the median and the range of seven rounds:"]
    return "\n\n".join([*parts, table([*headers, *methods], times)])


def work_cell(row) -> str:
    """Steps, and what is done in them."""
    return "none" if row.steps is None else f"{row.steps} ({row.units:.0f})"


def time_cell(seconds, best: float) -> str:
    """Microseconds; the smallest median of a rope is bold."""
    if seconds is None:
        return "none"
    middle, low, high = (1e6 * each for each in seconds)
    shown = f"**{middle:.3g}**" if seconds[0] == best else f"{middle:.3g}"
    return f"{shown} [{low:.3g}, {high:.3g}]"


def small_step_damping() -> str:
    """The damping that methods add: the picture, and a table."""
    found = damping_rates()
    words = "damping of the slowest swing and its frequency against steps per frame"
    return f"{picture(plot_damping(found), 'small-steps-damping.png', words)}\n\n" + table(
        ["method", "steps/frame", "measured", "of the step", "implicit Euler", "frequency"],
        [damping_row(each) for each in found],
        words=1,
    )


def damping_row(each) -> list[str]:
    """A line of that table. Rates of a method that keeps the amplitude are rounding."""
    rates = (each.measured, each.of_step, each.implicit_euler)
    shown = ["0" if abs(rate) < 1e-9 else f"{rate:.3e}" for rate in rates]
    return [each.method, str(each.steps), *shown, f"{each.speed:.4f}"]


@functools.cache
def measured_peers():
    """What `benchmarks/peers.py` measured last, and what shows it; nothing is measured here."""
    here = Path(__file__).parent
    sys.path.append(str(here.parent / "benchmarks"))
    from against import tables

    return tables, json.loads((here / "data/peers.json").read_text())


def peers(name: str) -> str:
    """A table of the stored results."""
    tables, results = measured_peers()
    return tables.TABLES[name](results)


def peers_chart() -> str:
    """The time of every peer in every case over that of ropeode, as one picture."""
    tables, results = measured_peers()
    panels: dict[str, Besides] = {}
    for each in tables.beside(results):
        # Its nodes, its ropes, or else the problem by name.
        size = re.search("[0-9]+ (nodes|ropes)", each.case) or re.match("[^,]+", each.case)
        peer = re.sub("scikit-sundae | Taylor, float64| BDF| Adams| \\(odeint\\)", "", each.peer)
        of_peer = panels.setdefault(tables.PARTS[each.part], {}).setdefault(peer, {})
        of_peer.setdefault(size[0] if size else "", []).append(each.ratio)
    words = "time of each peer over that of ropeode"
    every = [each.ratio.median for each in tables.beside(results)]
    won = (
        f"ropeode takes less time in {sum(each > 1 for each in every)} of {len(every)} comparisons."
    )
    return f"{picture(plot_besides(panels), 'peers.png', words)}\n\n{won}"


def judged(program: str, *show: str) -> str:
    """What `benchmarks/mutants.py` or `false_alarms.py` found last; nothing is judged here."""
    here = Path(__file__).parent
    made = [here.parent / f"benchmarks/{program}.py", "--out", here / f"data/{program}.jsonl"]
    return subprocess.run(
        [sys.executable, *made, "--show", *show], check=True, capture_output=True, text=True
    ).stdout.rstrip()


def published() -> str:
    """What `benchmarks/published.py` found last; nothing is certified here."""
    rows = json.loads((Path(__file__).parent / "data/published.json").read_text())
    heads = (
        "problem",
        "unknowns",
        "end values",
        "solver",
        "certified to",
        "bound",
        "error",
        "seconds",
    )
    cells = [
        [
            row["name"],
            str(row["unknowns"]),
            "published" if row["published"] else f"two codes, {row['agreed']:.0e} apart",
            row["solver"],
            f"{row['accuracy']:.0e}",
            f"{row['bound']:.0e}",
            f"{'< ' * (row['error'] < known)}{max(row['error'], known):.0e}",
            f"{row['runs']:.1f}",
        ]
        for row in rows
        if row["accuracy"]
        for known in [row.get("agreed", 0.0)]
    ]
    refused = [f"- {row['name']}: {row['why']}" for row in rows if not row["accuracy"]]
    return "\n".join([table(heads, cells, {0, 2, 3}), "", *refused]).rstrip()


def predicted_errors() -> str:
    """How many predicted errors the runs confirmed, and each that is further apart."""
    words, _, rows = judged("predicted_errors").partition("\n\n| ")
    return f"{words}\n\n{folded('Those that are further apart', f'| {rows}')}"


def false_alarms() -> str:
    """How many checks reject a right stepper, and each of them."""
    words, _, rows = judged("false_alarms").partition("\n\n\n| ")
    return f"{words}\n\n{folded('By check', f'| {rows}')}"


def failed_checks(example: str) -> str:
    """What `ropeode check` prints of a wrong example, without the checks that pass."""
    here = Path(__file__).parent
    run = [sys.executable, "-m", "ropeode", "check", f"examples/{example}", "--order", "2"]
    text = subprocess.run(run, cwd=here, capture_output=True, text=True).stdout
    opening, rest = re.split(r"\n\n(?=ok )", text, maxsplit=1)
    findings = rest.partition("\n\nLargest errors")[0]
    wrong = [each for each in re.split(r"\n(?=\S)", findings) if each.startswith("WRONG")]
    return "\n".join(["```text", opening, "", *wrong, "```"])


def judged_inside() -> str:
    """A table that goes past the horizon."""
    problem, steps = Rope(damping=0.0).problem(LONG), (64, 128, 256)
    return f"```text\n{format_table(accuracy_table(problem, ['rk4'], steps))}```"


def lab_lessons() -> str:
    """The lessons of the lab, with their sentences and their pictures."""
    return "\n\n".join(
        f"## {each.title['en']}\n\n"
        f"`ropeode lab --scene {each.name}`\n\n"
        f"{each.text['en'].strip()}\nMore: [{each.page.partition('/')[2]}](../{each.page}.md).\n\n"
        f"![The lab with the lesson {each.name}](../images/lab-{each.name}.webp)"
        for each in scenes()
        if not each.name.startswith("figure-")
    )


def lab_figures() -> str:
    """The scenes of the report's figures, as sheets of pictures."""
    figures = [each for each in scenes() if each.name.startswith("figure-")]
    sheets = []
    for number, first in enumerate(range(0, len(figures), OF_A_SHEET), start=1):
        names = [each.name for each in figures[first : first + OF_A_SHEET]]
        words = f"The lab with {names[0]} to {names[-1]}"
        sheets.append(f"![{words}](../images/lab-figures-{number}.webp)")
    return "\n\n".join(sheets)


def public_names() -> str:
    """Every public name, by the room that it comes from, for autosummary."""
    rooms: dict[str, list[str]] = {}
    stub = (Path(ropeode.__file__).parent / "__init__.pyi").read_text()
    for source, name in re.findall(r"^from \.(\S+) import (\w+) as \2$", stub, re.MULTILINE):
        rooms.setdefault(source.partition(".")[0], []).append(name)
    return "\n\n".join(
        f"## ropeode.{room}\n\n```{{eval-rst}}\n.. currentmodule:: ropeode\n\n"
        f".. autosummary::\n   :toctree: names\n   :nosignatures:\n\n"
        + "\n".join(f"   {name}" for name in names)
        + "\n```"
        for room, names in rooms.items()
        if names
    )
