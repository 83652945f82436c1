"""Writes `verdicts.json`: what became of the report's claims. It takes minutes.

Run it as ``python -m ropeode.laboratory.scenes.make_verdicts``.
"""

from __future__ import annotations

import json
from importlib import resources
from pathlib import Path

from ropeode.case_studies import Report, rope_report
from ropeode.files import write_whole


def verdicts_of(report: Report) -> dict[str, dict[str, str]]:
    """The verdict and the measurement of each figure, by its number."""
    return {
        str(each.figure.figure): {"verdict": each.verdict, "measured": each.measured}
        for each in report.figures
    }


if __name__ == "__main__":
    contents = json.dumps(verdicts_of(rope_report()), indent=1, ensure_ascii=False) + "\n"
    path = Path(str(resources.files("ropeode.laboratory.scenes"))) / "verdicts.json"
    write_whole(path, contents.encode())
