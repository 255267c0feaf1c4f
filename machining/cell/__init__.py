"""The machining cell: what stands where, what carries the robot and the part, and the arm's clearance in it."""

from typing import TYPE_CHECKING

from robots.lazily import lazily

if TYPE_CHECKING:
    from machining.cell.arm_solids import ArmBodies, arm_bodies, arm_of
    from machining.cell.cell import Cell, Fixture, LinearAxis, Tool, Turntable
    from machining.cell.distances import Clearance, clearance, clearance_of
    from machining.cell.reading import parse_cell, read_cell
    from machining.cell.scene import Scene, scene_of
    from machining.cell.solids import Body, Solid, box, capsule, cylinder, hull, mesh_file, sphere, surface
else:
    __getattr__ = lazily(__name__)

__all__ = [
    "ArmBodies",
    "Body",
    "Cell",
    "Clearance",
    "Fixture",
    "LinearAxis",
    "Scene",
    "Solid",
    "Tool",
    "Turntable",
    "arm_bodies",
    "arm_of",
    "box",
    "capsule",
    "clearance",
    "clearance_of",
    "cylinder",
    "hull",
    "mesh_file",
    "parse_cell",
    "read_cell",
    "scene_of",
    "sphere",
    "surface",
]
