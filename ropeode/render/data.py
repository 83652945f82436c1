"""Results for other programs: JSON and CSV."""

from __future__ import annotations

import csv
import io
import json
import math
from typing import Any

from ropeode.json_form import json_of
from ropeode.render.results import rows


def json_text(result: Any) -> str:
    """A result as JSON, which begins with the name of its schema."""
    form = {"schema": result.SCHEMA, **json_of(result)}
    return json.dumps(form, indent=2, allow_nan=False, ensure_ascii=False) + "\n"


def csv_text(result: Any) -> str:
    """The rows of a result as CSV, under the names of all columns; what does not exist is empty."""
    lines = rows(result)
    text = io.StringIO()
    names = list(dict.fromkeys(name for line in lines for name in line))
    writer = csv.DictWriter(text, fieldnames=names, lineterminator="\n")
    writer.writeheader()
    writer.writerows({name: _finite(value) for name, value in line.items()} for line in lines)
    return text.getvalue()


def _finite(value: Any) -> Any:
    return None if isinstance(value, float) and not math.isfinite(value) else value
