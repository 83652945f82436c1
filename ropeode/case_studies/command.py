"""The command `ropeode report`."""

from __future__ import annotations

from pathlib import Path

import click

from ropeode.progress import Progress
from ropeode.terminal import (
    CommaSeparated,
    end_on_ctrl_c,
    format_for,
    format_option,
    out_option,
    plots_option,
    put_out,
    put_pictures,
    set_up_jax,
    with_progress,
)


@click.command("report")
@click.option("--figures", metavar="N[,N...]", type=CommaSeparated(), help="From 1 to 41. [all]")
@click.option("--frames", metavar="N", help="Frames to watch. [4000, or more where needed]")
@plots_option("Write a picture for each figure, and sheets, to DIR.")
@format_option
@out_option("report")
def report_command(
    figures: list[str] | None,
    frames: str | None,
    plots: Path | None,
    form: str | None,
    out: Path | None,
) -> None:
    """Run the published rope report again, claim by claim.

    All its figures take minutes. If you interrupt the command, it keeps the runs that are
    finished, and the same command goes on from there. Pictures need matplotlib: pip install
    '.[plots]'.
    """
    form = format_for(form, out)
    if plots:
        from ropeode.case_studies.pictures import draw_report
    set_up_jax()
    end_on_ctrl_c("finished runs are kept; the same command goes on from there")
    import platformdirs

    from ropeode.case_studies.report import rope_report
    from ropeode.case_studies.results import format_report

    def work(progress: Progress) -> tuple[str, dict[str, bytes]]:
        result = rope_report(
            figures,  # type: ignore[arg-type]
            frames,  # type: ignore[arg-type]
            folder=platformdirs.user_cache_path("ropeode") / "report",
            progress=progress,
        )
        pictures = draw_report(result, progress) if plots else {}
        return format_report(result, form), pictures

    text, pictures = with_progress(work)
    if plots:
        put_pictures(pictures, plots)
    put_out(text, out)
