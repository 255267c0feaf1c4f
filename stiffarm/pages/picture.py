"""A picture by itself, as Python users hold it."""

from __future__ import annotations

import io
from pathlib import Path
from typing import TYPE_CHECKING

from robots import InputError

if TYPE_CHECKING:
    from matplotlib.figure import Figure


class Picture:
    """A picture: shows itself in a notebook; ``save`` writes it."""

    def __init__(self, png: bytes) -> None:
        self.png = png

    @classmethod
    def of(cls, figure: Figure) -> Picture:
        """A figure as PNG, as the reports have it."""
        from stiffarm.pages import style
        from stiffarm.pages.band import banded, in_the_file

        buffer = io.BytesIO()
        with style.house_style(), banded(figure) as shape:
            figure.savefig(buffer, format="png", dpi=style.DPI, metadata=in_the_file(), **shape)
        return cls(buffer.getvalue())

    def _repr_png_(self) -> bytes:
        return self.png

    def __repr__(self) -> str:
        return f"Picture ({len(self.png) // 1024} kB; save(file) writes it)"

    def save(self, file: str | Path) -> Path:
        """Write the picture as PNG; returns the path."""
        from robots.files.written import write_whole

        path = Path(file)
        if path.suffix.lower() != ".png":
            raise InputError(
                "picture file", code="B004", value=str(path), allowed="a name ending in .png", remedy="add .png"
            )
        write_whole(path, self.png)
        return path

    def kept(self, file: str | Path | None) -> Picture:
        """The picture itself, written to ``file`` where one is given."""
        if file is not None:
            self.save(file)
        return self
