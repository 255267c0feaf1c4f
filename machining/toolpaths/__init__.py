"""Tool paths from CAM: APT and CLSF files, G-code, CSV; the moves as arrays, in SI units."""

from typing import TYPE_CHECKING

from robots.lazily import lazily

if TYPE_CHECKING:
    from machining.toolpaths.apt.reader import read_apt
    from machining.toolpaths.arcs import ArcError, arc_points
    from machining.toolpaths.conversion import CuttingPath, GivenPath, cutting_runs, read_given_path, to_tool_path
    from machining.toolpaths.cycles import Cycle, Stroke
    from machining.toolpaths.gcode.reader import read_gcode
    from machining.toolpaths.gcode.rotary import tool_axis
    from machining.toolpaths.heidenhain.reader import read_heidenhain
    from machining.toolpaths.motions import Event, Motions, Note, Tool
    from machining.toolpaths.options import ReadOptions
    from machining.toolpaths.reading import read_toolpath
    from machining.toolpaths.tables import read_motions, write_motions
else:
    __getattr__ = lazily(__name__)

__all__ = [
    "ArcError",
    "CuttingPath",
    "Cycle",
    "Event",
    "GivenPath",
    "Motions",
    "Note",
    "ReadOptions",
    "Stroke",
    "Tool",
    "arc_points",
    "cutting_runs",
    "read_apt",
    "read_gcode",
    "read_given_path",
    "read_heidenhain",
    "read_motions",
    "read_toolpath",
    "to_tool_path",
    "tool_axis",
    "write_motions",
]
