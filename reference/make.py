"""Compute the stored library again: `make references`, or some of it by name.

    python reference/make.py [NAME ...]

Each recipe, NAME.toml, gives a data file, NAME.nc, and an entry in manifest.json.
"""

from __future__ import annotations

import json
import sys
import time
from pathlib import Path

from ropeode.files import write_whole
from ropeode.references import (
    MANIFEST,
    Entry,
    read_recipe,
    reference_for,
    save_reference,
    verify_checksum,
)
from ropeode.terminal import set_up_jax, show_progress

HERE = Path(__file__).resolve().parent


def make(name: str) -> Entry:
    """Compute one reference and write it."""
    recipe, recipe_digest = read_recipe(HERE / f"{name}.toml")
    with show_progress() as progress:
        reference = reference_for(
            recipe.build(),
            recipe.options,
            lambda text, fraction: progress(f"{name}: {text}", fraction),
        )
    error = recipe.published_error(reference)
    if error is not None and error > reference.bound()[-1] + recipe.published.uncertainty:
        raise SystemExit(f"{name}: {error:.1e} away from {recipe.published.source}")
    path = save_reference(reference, HERE / f"{name}.nc")
    return Entry(
        title=recipe.title,
        problem=recipe.problem,
        samples=reference.trusted,
        end=float(reference.times[reference.trusted - 1]),
        level=reference.certificate.level,
        bound=float(reference.bound()[-1]),
        horizon=reference.horizon,
        sha256=verify_checksum(path),
        recipe_sha256=recipe_digest,
    )


def main(names: list[str]) -> None:
    """Compute the named references, or all of them."""
    set_up_jax()
    recipes = sorted(path.stem for path in HERE.glob("*.toml"))
    for name in names or recipes:
        began = time.perf_counter()
        entry = make(name)
        # After each reference, and read again: none is lost if the next one is interrupted, or if
        # another process computes others.
        manifest = HERE / MANIFEST
        entries = json.loads(manifest.read_text()) if manifest.exists() else {}
        entries = {each: entries[each] for each in recipes if each in entries}
        entries[name] = entry._asdict()
        write_whole(manifest, json.dumps(dict(sorted(entries.items())), indent=1) + "\n")
        print(
            f"{name}: {entry.level}, bound {entry.bound:.1e} at t = {entry.end:g}, horizon "
            f"{entry.horizon}, {time.perf_counter() - began:.1f} s",
            flush=True,
        )


if __name__ == "__main__":
    main(sys.argv[1:])
