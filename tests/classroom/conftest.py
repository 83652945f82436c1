"""The files of a class, and what is read of its grade book."""

from __future__ import annotations

import csv

import pytest


def write(folder, texts):
    """Write texts to the files of these names."""
    for name, text in texts.items():
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        (folder / name).write_text(text)


@pytest.fixture
def rows_in():
    """The rows of a grade book in a folder, by the names of submissions."""

    def read(folder):
        with open(folder / "gradebook.csv") as file:
            return {row["submission"]: row for row in csv.DictReader(file)}

    return read
