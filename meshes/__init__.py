"""The links' shape: sections and beam meshes (shell meshes stand beside them later)."""

from meshes.beams import BeamMesh, crank_beam_mesh, link_beam_mesh
from meshes.sections import SectionProperties, section_dimensions, section_properties

__all__ = [
    "BeamMesh",
    "SectionProperties",
    "crank_beam_mesh",
    "link_beam_mesh",
    "section_dimensions",
    "section_properties",
]
