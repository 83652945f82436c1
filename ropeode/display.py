"""How results look in the REPL, and in notebooks."""

from __future__ import annotations

from typing import Any

from ropeode import rooms_above
from ropeode.equality import ByContent

# Of a result's headings, in the middle of somebody's notebook.
_HEADINGS = 4


class Displayed(ByContent):
    """A result that the REPL shows as one line, and a notebook as a page.

    Both are written by `ropeode.render`, which is imported when a result is first shown.
    """

    def __repr__(self) -> str:
        return f"<{type(self).__name__}: {rooms_above.render().line(self)}>"

    def _repr_markdown_(self) -> str:
        """What a notebook shows where it shows no HTML."""
        render = rooms_above.render()
        return render.markdown(render.blocks(self), level=_HEADINGS)

    def _repr_html_(self) -> str:
        """What a notebook shows."""
        render = rooms_above.render()
        return render.html_part(render.blocks(self), level=_HEADINGS)


class Tabular(Displayed):
    """A result that is also a table of numbers."""

    def to_dataframe(self) -> Any:
        """A pandas DataFrame: a row for each sample, run or check. It needs the extra `data`.

        Examples:
            >>> from ropeode import Rope, simulate
            >>> run = simulate(Rope(num_nodes=4).problem(frames=3), "rk4", steps_per_frame=16)
            >>> run.to_dataframe()[["time", "x3", "y3"]].round(2)
               time      x3      y3
            0   0.0 -400.00  200.00
            1   1.0 -400.00  199.50
            2   2.0 -399.99  198.01
            3   3.0 -399.93  195.54
        """
        return rooms_above.render().dataframe(self)


class Sampled(Tabular):
    """A result that has states at sample times."""

    def to_xarray(self) -> Any:
        """An xarray Dataset with axes time, node and component; of many runs, also member.

        It needs the extra `data`.

        Examples:
            >>> from ropeode import Rope, simulate
            >>> run = simulate(Rope(num_nodes=4).problem(frames=3), "rk4", steps_per_frame=16)
            >>> run.to_xarray()["position"].sel(time=3.0, node=3).values.round(2)
            array([-399.93,  195.54])
        """
        return rooms_above.render().dataset(self)
