"""The links' shape: sections, beam meshes and casings as shells."""

from meshes.beams import BeamMesh, crank_beam_mesh, element_axes, link_beam_mesh
from meshes.casings import casing_mesh
from meshes.sections import SectionProperties, section_dimensions, section_properties
from meshes.shell_mesh import ShellMesh
from meshes.surface_import import ImportedLink, import_surface

__all__ = [
    "BeamMesh",
    "ImportedLink",
    "SectionProperties",
    "ShellMesh",
    "casing_mesh",
    "crank_beam_mesh",
    "element_axes",
    "import_surface",
    "link_beam_mesh",
    "section_dimensions",
    "section_properties",
]
