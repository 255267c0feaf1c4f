"""Small helpers of the report's sections: numbers in words, names, pictures."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

from stiffarm.pages.report import Block, Fold, Later, Picture
from stiffarm.session.outputs import OutputFolder

if TYPE_CHECKING:
    from matplotlib.figure import Figure


class Pictures:
    """Saves figures into the output folder and hands them to the report; ``before``: what their names begin with."""

    def __init__(self, folder: OutputFolder, before: str = "") -> None:
        self.folder, self.before = folder, before

    def add(self, figure: Figure, name: str, caption: str, alt: str = "") -> Picture:
        """Save a figure under ``figures/`` and return it with its caption; ``alt``: what it is, else its name."""
        from stiffarm.pages.style import save_png

        path = self.folder.path(f"figures/{self.before}{name}.png")
        save_png(figure, path)
        return Picture(path, caption, alt or name.replace("_", " "))


def within(blocks: Sequence[Block]) -> Iterator[Block]:
    """Blocks and those folded into them."""
    for block in blocks:
        yield block
        if isinstance(block, Fold):
            yield from within(block.blocks)


def placed(blocks: Sequence[Block], pictures: Pictures, without: object = None) -> tuple[Block, ...]:
    """Blocks with the tables and pictures of a result as a page shows them, all but the one ``without``."""
    out: list[Block] = []
    for block in blocks:
        if isinstance(block, Fold):
            out.append(replace(block, blocks=placed(block.blocks, pictures, without)))
        elif block is not without:
            out.append(block.placed(pictures) if isinstance(block, Later) else block)
    return tuple(out)
