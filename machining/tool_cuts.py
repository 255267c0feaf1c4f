"""The cut of each tool of a cell's changer, from the milling files that the cell file names."""

from __future__ import annotations

from machining.cell.cell import Cell
from machining.cutting.each_tool import BendingOfEach, ForceOfEach
from machining.cutting.milling_file import Cut, read_milling
from machining.tooling import tools_of
from machining.toolpaths.motions import Motions


def cut_of_tools(cell: Cell, motions: Motions) -> Cut | None:
    """The cut of each tool of a path by the milling files that the cell names for them; None: it names none of them.

    Raises
    ------
    InputError
        A milling file that cannot be read, or a tool that the cell does not have.
    """
    used = set(motions.tool.tolist())
    files = [tool.milling if i in used else None for i, tool in enumerate(tools_of(cell, motions))]
    cuts = [None if file is None else read_milling(file) for file in files]
    if not any(cuts):
        return None
    forces, bendings = (
        tuple(None if cut is None else getattr(cut, name) for cut in cuts) for name in ("force", "tool")
    )
    names = tuple(tool.name or f"tool {tool.number}" for tool in motions.tools)
    return Cut(
        ForceOfEach(forces, names, motions.tool), BendingOfEach(bendings, motions.tool) if any(bendings) else None
    )
