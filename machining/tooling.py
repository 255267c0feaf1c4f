"""Which tool of a cell each move of a tool path has on the flange."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from robots import InputError
from robots.arrays import Array
from robots.errors import listed

if TYPE_CHECKING:
    from machining.cell.cell import Cell
    from machining.cell.cell import Tool as CellTool
    from machining.toolpaths.conversion import GivenPath
    from machining.toolpaths.motions import Motions, Tool


# Tools that a message names.
MOST_NAMED = 12


def tools_of(cell: Cell, motions: Motions) -> tuple[CellTool, ...]:
    """Of each of the path's tools, what the cell puts on the flange; its one tool for those without a move.

    A cell without a table of tools has its one tool for all: :func:`require_tools` says where that cannot be meant.

    Raises
    ------
    InputError
        A tool that the cell's table does not have; errors as :func:`the_one_tool`.
    """
    used = np.unique(motions.tool)
    if not cell.tools:
        return (cell.tool,) * len(motions.tools)
    if len(used) == 1 and motions.tools[int(used[0])].number is None and not motions.tools[int(used[0])].name:
        return (the_one_tool(cell, f"tool path {motions.source}"),) * len(motions.tools)
    out = [cell.tool] * len(motions.tools)
    for i in used.tolist():
        found = _found(cell, motions.tools[i])
        if found is None:
            line = int(motions.line[int(np.argmax(motions.tool == i))])
            number = motions.tools[i].number
            raise InputError(
                f"tool path {motions.source}, line {line}: the cell file has no table of {_named(motions, i)}",
                code="K003",
                value=motions.tools[i].name or number,
                allowed=listed(f"[tools.{one.name if one.number is None else one.number}]" for one in cell.tools),
                remedy=f"add [tools.{motions.tools[i].name or 'NAME' if number is None else number}] with the frame of "
                "that tool on the flange, or choose others with --tool-number or --operation",
            )
        out[i] = found
    return tuple(out)


def the_one_tool(cell: Cell, path: str) -> CellTool:
    """The tool that is on the flange for a path that names none.

    Raises
    ------
    InputError
        The cell has tools of a changer, and none that is there without it.
    """
    if cell.tools and np.array_equal(cell.tool.T_flange_tool, np.eye(4)) and not (cell.tool.holder or cell.tool.cutter):
        raise InputError(
            f"{path} names no tool",
            code="K003",
            allowed="a tool of the path, for the cell file has tables of a changer's tools only",
            remedy="add [tool] to the cell file: what is on the flange without a change",
        )
    return cell.tool


def require_tools(cell: Cell, motions: Motions | None) -> None:
    """Raise InputError unless the cell has all tools of the path: its one tool, or a table with each of them.

    ``motions`` None: a table of points, without tools.
    """
    if motions is None:
        return
    used = np.unique(motions.tool).tolist()
    if cell.tools or len(used) < 2:
        tools_of(cell, motions)
        return
    said = [motions.tools[i].name or str(motions.tools[i].number) for i in used]
    raise InputError(
        f"tool path {motions.source} uses {len(used)} tools",
        code="K003",
        value=listed(said),
        allowed=f"one, where the cell has one: {'; '.join(_named(motions, i) for i in used[:MOST_NAMED])}",
        remedy="give the cell file a table of each, [tools.NUMBER], or choose with --tool-number or --operation "
        "(tool_numbers=, operations= in Python)",
    )


def tool_frames(cell: Cell, motions: Motions) -> Array:
    """Tool frames on the flange: (4, 4) m where all moves have one, else (n, 4, 4). Errors as :func:`tools_of`."""
    tools = tools_of(cell, motions)
    if len({id(tools[i]) for i in np.unique(motions.tool)}) == 1:
        return tools[int(motions.tool[0])].T_flange_tool
    return np.stack([tool.T_flange_tool for tool in tools])[motions.tool]


def given_frames(cell: Cell, given: GivenPath) -> Array:
    """Tool frames on the flange at a path's points; errors as :func:`require_tools`."""
    if given.motions is None:
        return the_one_tool(cell, "the table of points").T_flange_tool
    require_tools(cell, given.motions)
    frames = tool_frames(cell, given.motions)
    return frames if frames.ndim == 2 else frames[given.moves]


def numbered(cell: Cell, motions: Motions) -> Motions:
    """The same, tools that the path only names with their numbers in the cell's changer."""
    tools = []
    for tool in motions.tools:
        found = _found(cell, tool) if tool.number is None else None
        tools.append(tool if found is None or found.number is None else replace(tool, number=found.number))
    return replace(motions, tools=tuple(tools))


def _found(cell: Cell, tool: Tool) -> CellTool | None:
    """The changer's tool of a number, else of a name, in any case."""
    for one in cell.tools:
        if tool.number is not None and one.number == tool.number:
            return one
    name = tool.name.strip().lower()
    return next((one for one in cell.tools if name and one.name.strip().lower() == name), None)


def _named(motions: Motions, tool: int) -> str:
    """A tool by its number, and the operations that it is used in, as far as the file names them."""
    number = motions.tools[tool].number
    names = [motions.operations[i] for i in np.unique(motions.operation[motions.tool == tool])]
    said = listed([repr(name) for name in names if name.strip()])
    return ("no number" if number is None else f"tool number {number}") + (f" for {said}" if said else "")
