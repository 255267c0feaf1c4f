"""Masses of casings and of a robot's parts, from their geometry and their material's density."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from meshes.beams import BeamMesh, crank_beam_mesh, link_beam_mesh
from meshes.link_shells import link_shell_mesh
from meshes.sections import section_dimensions, section_properties
from meshes.shell_mesh import ShellMesh
from robots import ModelDescription, Robot
from robots.arrays import Array
from robots.schema.description import Link


@dataclass(frozen=True)
class PointMass:
    """A mass in kg and its centre (3,) m, in the frame of the mesh."""

    kg: float
    centre: Array


@dataclass(frozen=True)
class LinkMass:
    """A link's casing (or the prepared surface in its place), and the mass declared.

    The declared mass holds the casing, the drives and gears in it, and the cabling.
    """

    name: str
    casing: PointMass
    declared_kg: float | None

    @property
    def rest_kg(self) -> float | None:
        """What the link carries beside its casing, kg; negative where the declared mass is too small."""
        return None if self.declared_kg is None else self.declared_kg - self.casing.kg


@dataclass(frozen=True)
class RobotMasses:
    """Masses of a robot's parts: links from base to tip, the parallelogram's bar and crank (None without one)."""

    links: tuple[LinkMass, ...]
    bar_kg: float | None
    crank: PointMass | None
    robot_kg: float | None

    @property
    def sum_kg(self) -> float | None:
        """Declared masses of the links, bar and crank together, kg; None if a link declares none."""
        declared = [link.declared_kg for link in self.links if link.declared_kg is not None]
        if not declared or len(declared) < len(self.links):
            return None
        return sum(declared) + (self.bar_kg or 0.0) + (0.0 if self.crank is None else self.crank.kg)

    @property
    def difference_kg(self) -> float | None:
        """Sum of the parts less the robot's own mass, kg."""
        return None if self.sum_kg is None or self.robot_kg is None else self.sum_kg - self.robot_kg


def shell_mass(mesh: ShellMesh, density: float) -> PointMass:
    """Mass of a shell mesh, ``rho sum A_e t_e``, and its centre; density in kg/m^3.

    Exact for flat elements. A warped quad counts as the two triangles at its first diagonal.
    """
    t = mesh.thickness
    quads, m = mesh.quad_corners, len(mesh.triangles)
    corners = np.concatenate([mesh.triangle_corners, quads[:, [0, 1, 2]], quads[:, [0, 2, 3]]])
    area = 0.5 * np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1)
    return _total(density * area * np.concatenate([t, t[m:]]), corners.mean(axis=1))


def beam_mass(mesh: BeamMesh, density: float) -> PointMass:
    """Mass of beams, ``rho int A dx``, and its centre; density in kg/m^3.

    Simpson's rule is exact here: with dimensions linear along an element, the area is of second degree.
    """
    ends = mesh.nodes[mesh.elements]
    length = np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1)
    middle = mesh.dimensions.mean(axis=1, keepdims=True)
    stations = np.concatenate([mesh.dimensions[:, :1], middle, mesh.dimensions[:, 1:]], axis=1)
    area = section_properties(mesh.kind, stations, mesh.poissons_ratio).area
    points = np.stack([ends[:, 0], ends.mean(axis=1), ends[:, 1]], axis=1)
    share = density * length[:, None] * area * np.array([1.0, 4.0, 1.0]) / 6.0
    return _total(share.ravel(), points.reshape(-1, 3))


def robot_masses(description: ModelDescription, robot: Robot) -> RobotMasses:
    """Weigh a robot: casings as their shell meshes, bar and crank as beams, beside the masses the file declares.

    Raises
    ------
    InputError
        A link whose shell :func:`meshes.link_shell_mesh` refuses.
    """
    links = tuple(
        LinkMass(
            link.name,
            _casing(description, robot, link),
            None if link.mass is None else link.mass.si,
        )
        for link in description.link
    )
    bar, crank = None, None
    p = description.parallelogram
    if p is not None and robot.parallelogram is not None:
        material = description.materials[p.bar_material]
        area = section_properties(p.bar.kind, section_dimensions(p.bar), material.poissons_ratio.si).area
        # Crank and lever are parallel and equally long, so the bar is as long as the link beside it.
        length = float(np.linalg.norm(robot.T_pre[robot.parallelogram.driven][:3, 3]))
        bar = material.density.si * float(area) * length
        crank = beam_mass(crank_beam_mesh(description, robot), description.materials[p.crank_material].density.si)
    return RobotMasses(links, bar, crank, None if description.mass is None else description.mass.si)


def _casing(description: ModelDescription, robot: Robot, link: Link) -> PointMass:
    mesh = link_shell_mesh(link, link_beam_mesh(description, robot, link))
    return shell_mass(mesh, description.materials[link.material].density.si)


def _total(masses: Array, points: Array) -> PointMass:
    total = float(masses.sum())
    return PointMass(total, np.asarray(masses @ points / total))
