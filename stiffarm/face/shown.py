"""How results show themselves: as a short table, in a terminal and in a notebook, never as pages of arrays."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    import pandas as pd

ROWS_SHOWN = 12


def frame(rows: dict[str, Any] | Sequence[Mapping[str, Any]]) -> pd.DataFrame:
    """A data frame of columns by name, or of rows; pandas is loaded when the first one is asked for."""
    import pandas as pd

    return pd.DataFrame(rows)


class Shown:
    """A result with a title and a table: :meth:`title` and :meth:`to_frame` are its own."""

    def title(self) -> str:
        """What the result is, in one line."""
        raise NotImplementedError

    def to_frame(self) -> pd.DataFrame:
        """The result's rows, with units in the names of columns."""
        raise NotImplementedError

    def __repr__(self) -> str:
        frame = self.to_frame()
        if frame.empty:
            return self.title()
        shown = frame.head(ROWS_SHOWN).to_string(index=False, na_rep="-", float_format=lambda v: f"{v:.6g}")
        return "\n".join([self.title(), shown, *_more(len(frame))])

    def _repr_html_(self) -> str:
        import html

        frame = self.to_frame()
        table = frame.head(ROWS_SHOWN).to_html(index=False, na_rep="-", border=0, float_format=lambda v: f"{v:.6g}")
        more = "".join(f"<p>{line}</p>" for line in _more(len(frame)))
        return f"<p>{html.escape(self.title())}</p>{table}{more}"


def _more(rows: int) -> list[str]:
    return [f"({ROWS_SHOWN} of {rows} rows; to_frame() has all)"] if rows > ROWS_SHOWN else []
