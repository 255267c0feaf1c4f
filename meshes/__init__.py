"""The links' shape: sections, beam meshes and casings as shells."""

from typing import TYPE_CHECKING

from robots.lazily import lazily

if TYPE_CHECKING:
    from meshes.beams import BeamMesh, crank_beam_mesh, element_axes, link_beam_mesh
    from meshes.casings import casing_mesh, casing_size
    from meshes.link_shells import link_shell_mesh, load_shell, save_shell
    from meshes.link_solids import link_solid_mesh, load_solid, save_solid
    from meshes.masses import LinkMass, PointMass, RobotMasses, beam_mass, robot_masses, shell_mass
    from meshes.sections import SectionProperties, section_dimensions, section_properties
    from meshes.shell_mesh import ShellMesh
    from meshes.solid_mesh import SolidMesh
    from meshes.surfaces.link import ImportedLink, import_surface
else:
    __getattr__ = lazily(__name__)

__all__ = [
    "BeamMesh",
    "ImportedLink",
    "LinkMass",
    "PointMass",
    "RobotMasses",
    "SectionProperties",
    "ShellMesh",
    "SolidMesh",
    "beam_mass",
    "casing_mesh",
    "casing_size",
    "crank_beam_mesh",
    "element_axes",
    "import_surface",
    "link_beam_mesh",
    "link_shell_mesh",
    "link_solid_mesh",
    "load_shell",
    "load_solid",
    "robot_masses",
    "save_shell",
    "save_solid",
    "section_dimensions",
    "section_properties",
    "shell_mass",
]
