"""The scenes of the lab that the tutorials name, each as a file that plays in the browser.

    python -m tools.site_scenes FOLDER

writes FOLDER/lab/NAME.html for each.
"""

from __future__ import annotations

import re
import sys
from pathlib import Path

from ropeode.files import write_whole
from ropeode.laboratory import Laboratory, link_of, page_with_answers
from ropeode.terminal import set_up_jax, with_progress

DOCS = Path(__file__).parents[1] / "docs"
# What a page calls a scene.
NAMED = re.compile(r"`ropeode lab --scene ([\w-]+)`")


def main(folder: Path) -> None:
    """Write the files."""
    set_up_jax()
    (folder / "lab").mkdir(parents=True, exist_ok=True)
    laboratory = Laboratory(None)
    pages = DOCS.glob("tutorials/*.md")
    for name in sorted({name for page in pages for name in NAMED.findall(page.read_text())}):
        link = link_of(None, name)
        # Over hundreds of frames the predictions of a plot that is not shown take minutes.
        theory = link["choices"] == {"steps": "order"}
        page = with_progress(
            lambda progress, link=link, theory=theory: page_with_answers(
                laboratory, link, progress, theory=theory
            )
        )
        write_whole(folder / "lab" / f"{name}.html", page)


if __name__ == "__main__":
    main(Path(sys.argv[1]))
