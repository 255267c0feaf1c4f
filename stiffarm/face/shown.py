"""How results show themselves: as a short table, in a terminal and in a notebook, never as pages of arrays."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

from stiffarm.result import as_html, as_text

if TYPE_CHECKING:
    import pandas as pd


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
        return as_text(self.title(), self.to_frame())

    def _repr_html_(self) -> str:
        return as_html(self.title(), self.to_frame())
