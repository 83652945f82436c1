"""Write what became of the claims of the published report, for the scenes of its figures.

``python -m tools.scene_verdicts`` writes ``ropeode/laboratory/scenes/verdicts.json``, in minutes.
"""

import json
from pathlib import Path

from ropeode.case_studies import Report, rope_report
from ropeode.files import write_whole

FILE = Path(__file__).parents[1] / "ropeode/laboratory/scenes/verdicts.json"


def verdicts_of(report: Report) -> dict[str, dict[str, str]]:
    """The verdict and the measurement of each figure, by its number."""
    return {
        str(each.figure.figure): {"verdict": each.verdict, "measured": each.measured}
        for each in report.figures
    }


if __name__ == "__main__":
    contents = json.dumps(verdicts_of(rope_report()), indent=1, ensure_ascii=False) + "\n"
    write_whole(FILE, contents.encode())
