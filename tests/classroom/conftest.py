"""The files of a class, and what is read of its grade book."""

from __future__ import annotations

import csv

from tests.cli.conftest import environment, run_process, started

__all__ = ["environment", "run_process", "started"]


def write(folder, texts):
    """Write texts to the files of these names."""
    for name, text in texts.items():
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        (folder / name).write_text(text)


def times(folder):
    """When each file of a folder was written."""
    return {each.name: each.stat().st_mtime_ns for each in folder.iterdir()}


def rows_in(folder):
    """The rows of the grade book in a folder, by the names of submissions."""
    with open(folder / "gradebook.csv") as file:
        return {row["submission"]: row for row in csv.DictReader(file)}
