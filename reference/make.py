"""Make the stored library again: `make references`, or some of it by name.

    python reference/make.py [NAME ...]

Each recipe, NAME.toml, makes a data file, NAME.nc; what was made is told in manifest.json.
"""

from __future__ import annotations

import json
import sys
import time
from pathlib import Path

from ropeode.files import write_whole
from ropeode.references.files.checksum import check_seal
from ropeode.references.files.library import MANIFEST, Entry
from ropeode.references.files.recipes import read_recipe
from ropeode.references.files.store import save_reference
from ropeode.terminal.running import set_up_jax, show_progress

HERE = Path(__file__).resolve().parent


def make(name: str) -> Entry:
    """Compute one reference and write it."""
    recipe, recipe_digest = read_recipe(HERE / f"{name}.toml")
    with show_progress() as progress:
        known = recipe.make(progress=lambda text: progress(f"{name}: {text}", 0.0))
    off = recipe.off_published(known)
    if off is not None and off > known.bound()[-1] + recipe.published.uncertainty:
        raise SystemExit(f"{name}: {off:.1e} away from {recipe.published.source}")
    path = save_reference(known, HERE / f"{name}.nc")
    return Entry(
        title=recipe.title,
        problem=recipe.problem,
        samples=known.trusted,
        end=float(known.times[known.trusted - 1]),
        level=known.certificate.level,
        bound=float(known.bound()[-1]),
        horizon=known.horizon,
        sha256=check_seal(path),
        recipe_sha256=recipe_digest,
    )


def main(names: list[str]) -> None:
    """Make the named references, or all."""
    set_up_jax()
    recipes = sorted(path.stem for path in HERE.glob("*.toml"))
    for name in names or recipes:
        began = time.perf_counter()
        entry = make(name)
        # After each, and read anew: nothing that has been made is lost when the next one is
        # interrupted, or when another process makes others.
        manifest = HERE / MANIFEST
        told = json.loads(manifest.read_text()) if manifest.exists() else {}
        told = {each: told[each] for each in recipes if each in told} | {name: entry._asdict()}
        write_whole(manifest, json.dumps(dict(sorted(told.items())), indent=1) + "\n")
        print(
            f"{name}: {entry.level}, bound {entry.bound:.1e} at t = {entry.end:g}, horizon "
            f"{entry.horizon}, {time.perf_counter() - began:.1f} s",
            flush=True,
        )


if __name__ == "__main__":
    main(sys.argv[1:])
