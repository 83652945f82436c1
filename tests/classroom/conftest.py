"""What is read of the grade book of a class."""

from __future__ import annotations

import csv

import pytest


@pytest.fixture
def rows_in():
    """The rows of a grade book in a folder, by the names of submissions."""

    def read(folder):
        with open(folder / "gradebook.csv") as file:
            return {row["submission"]: row for row in csv.DictReader(file)}

    return read
