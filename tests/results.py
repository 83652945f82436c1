"""What every result can do, whatever it is a result of."""

from __future__ import annotations

import copy
import pickle
from collections.abc import Iterator

import pandas as pd

from ropeode.display import Displayed, Sampled, Tabular

LONGEST = 200


def check_result(result: Displayed) -> None:
    """It shows itself, becomes a table, can be copied and sent, and is compared by its content."""
    line = repr(result)
    assert line.startswith(f"<{type(result).__name__}: ")
    assert "\n" not in line
    assert len(line) <= LONGEST, line
    for page in (result._repr_html_(), result._repr_markdown_()):
        assert page.strip()
        # Of a whole page these would change the notebook around it.
        assert "<style" not in page
        assert "<body" not in page
    if isinstance(result, Tabular):
        frame = result.to_dataframe()
        assert isinstance(frame, pd.DataFrame)
        assert len(frame) > 0
    if isinstance(result, Sampled):
        assert {"time", "node", "component"} <= set(result.to_xarray().sizes)
    for other in (pickle.loads(pickle.dumps(result)), copy.deepcopy(result), copy.copy(result)):
        assert other == result
        assert hash(other) == hash(result)
        assert repr(other) == line
    assert result != "something else"


def kinds(base: type = Displayed) -> Iterator[type]:
    """Every class of results."""
    for each in base.__subclasses__():
        if each not in (Tabular, Sampled):
            yield each
        yield from kinds(each)
