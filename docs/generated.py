"""What the pages of this folder have computed for them: `make docs` writes it into them.

Each function prints Markdown; pictures go to docs/images. The pages call them in comments that
the program cog carries out.
"""

from __future__ import annotations

import functools
import io
from pathlib import Path

from PIL import Image
from tabulate import tabulate

from ropeode import Rope, stability_limit
from ropeode.experiments.growth import growth_scan
from ropeode.experiments.report import Report, rope_report
from ropeode.experiments.rest_time import rest_times
from ropeode.experiments.sweeps import sweep_study
from ropeode.files import write_whole
from ropeode.render.plots.answers import plot_growth, plot_rest_times, plot_sweeps
from ropeode.render.plots.files import figure_bytes
from ropeode.render.plots.report import plot_contact_sheets
from ropeode.render.report import measured_words, summary, theory_words, threshold_words

IMAGES = Path(__file__).parent / "images"
# Enough for lines and text, and a third of the size.
_COLOURS = 128
DAMPINGS = (0.0, 0.001, 0.01, 0.1)


def table(headers: list[str], rows: list[list[str]], words: int | set[int] = 0) -> str:
    """A Markdown table; columns of words (the first ones, or those named) to the left."""
    left = set(range(words)) if isinstance(words, int) else words
    align = ["left" if column in left else "right" for column in range(len(headers))]
    cells = [[cell.replace("|", r"\|") for cell in row] for row in rows]
    return tabulate(cells, headers, tablefmt="pipe", disable_numparse=True, colalign=align)


def picture(figure, name: str, words: str) -> str:
    """A figure as a file of docs/images, and the Markdown that shows it."""
    IMAGES.mkdir(exist_ok=True)
    image = Image.open(io.BytesIO(figure_bytes(figure, ".png"))).convert("RGB")
    small = io.BytesIO()
    image.quantize(_COLOURS).save(small, "PNG", optimize=True)
    write_whole(IMAGES / name, small.getvalue())
    return f"![{words}](images/{name})"


def limits() -> str:
    """From how many steps per frame on the hanging rope is let alone, by damping."""
    stiffness = Rope().stiffness
    rows = []
    for damping in DAMPINGS:
        problem = Rope(damping=damping).problem(1)
        found = [
            stability_limit(problem, name) for name in ("explicit-euler", "semi-implicit-euler")
        ]
        bound = f"{4 * stiffness / damping:.0f}" if damping else "none"
        rows.append([f"{damping:g}", bound, *("none" if n is None else str(n) for n in found)])
    return table(["damping", "4k/damping", "explicit Euler", "semi-implicit Euler"], rows)


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
    return "\n\n".join(
        [
            picture(plot_growth(scan), "growth.png", words),
            table(["stepper", "steps/frame", "predicted", "measured", "difference"], rows, words=1),
        ]
    )


def rests() -> str:
    """When the Verlet ropes come to rest, and the picture."""
    found = [
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
        for each in found
    ]
    headers = ["rope", "damping", "steps/frame", "damping per frame", "at rest from", "product"]
    words = "frame of coming to rest against steps per frame"
    return "\n\n".join(
        [picture(plot_rest_times(found), "rest-time.png", words), table(headers, rows, words=2)]
    )


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


@functools.cache
def report() -> Report:
    """The whole report, run again."""
    return rope_report()


def figures() -> str:
    """All figures of the report."""
    rows = [
        [
            str(each.figure.figure),
            (each.figure.run_as or "-").split(":")[0],
            str(each.figure.steps_per_frame) if each.readings else "-",
            f"{each.figure.damping:g}" if each.readings else "-",
            each.figure.claim.replace("_", " "),
            measured_words(each),
            theory_words(each),
            f"**{each.verdict}**" if each.verdict != "holds" else each.verdict,
        ]
        for each in report().figures
    ]
    headers = [
        "figure",
        "stepper",
        "steps/frame",
        "damping",
        "claim",
        "measured",
        "theory",
        "verdict",
    ]
    return f"{summary(report())}\n\n{table(headers, rows, words={1, 4, 5, 6, 7})}"


def comparisons() -> str:
    """The claims that compare figures."""
    rows = [
        [
            ", ".join(map(str, each.comparison.figures)),
            each.comparison.claim,
            each.measured,
            f"**{each.verdict}**" if each.verdict != "holds" else each.verdict,
        ]
        for each in report().comparisons
    ]
    return table(["figures", "claim", "measured", "verdict"], rows, words=4)


def thresholds() -> str:
    """The thresholds, and the verdicts that hang on them."""
    return threshold_words(report())


def sheets() -> str:
    """Contact sheets of all figures."""
    return "\n\n".join(
        picture(sheet, f"report-{number}.png", f"figures of the report, sheet {number}")
        for number, sheet in enumerate(plot_contact_sheets(report()), start=1)
    )
