"""Fields on shells and solids from the condensed path: displacements, strain energy and stress of one pose and load.

Statics says what each part carries (:mod:`fem.statics.transfers`); a link's unit-load shapes, solved once, turn that
into displacements of its mesh with its root at rest. The chain's kinematics adds the motion of the root: turns
of the joints, deformations of the links before, and with a parallelogram the elbow's turn, which the bar's
shortening decides. A pose costs a few dense products, no factorisation.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import ArrayLike

from fem.elements.assembly import beside_quads, element_stiffness, freedoms
from fem.elements.couplings import rigid_motion
from fem.elements.facets import plane_stress
from fem.elements.quad import quad_frames
from fem.elements.shell import CoupledShell
from fem.elements.solid import solid_energy, solid_stress, von_mises_solid
from fem.elements.triangle import (
    ALPHA_B,
    bending_curvatures,
    facet_axes,
    membrane_strains,
)
from fem.model import ArmModel, LinkPart
from fem.reference.chain import Springs, build_chain
from fem.reference.shell_arm import all_links, both, couple_links, mesh_of, one_pose
from fem.statics.transfers import transfers
from fem.statics.vectors import poses_last
from meshes import ShellMesh, SolidMesh
from robots import InputError
from robots.arrays import Array
from robots.kinematics import forward_kinematics, tool_position

# Gradients of the bilinear functions at the middle of (-1, 1)^2, by direction and corner.
_MIDDLE = 0.25 * np.array([[-1.0, 1.0, 1.0, -1.0], [-1.0, -1.0, 1.0, 1.0]])
# Columns of a motion: by the parts' deformations, and by each rad that the elbow turns.
BY_PARTS, BY_ELBOW = np.eye(2)


@dataclass(frozen=True)
class LinkField:
    """One link's fields on its mesh (k nodes, e elements; of a shell the triangles first).

    ``R`` (3, 3), ``origin`` (3,) m: the unloaded body's frame in the base frame. ``displacement`` (k, 6) m and
    rad, base axes, rigid-body motion included. ``energy`` (e,) J. ``von_mises`` (e, 2) Pa at the element's
    middle, on the face the normal points to (corners counterclockwise seen from there) and on the other one; twice
    the same of a solid, whose nodes have no rotations.
    """

    name: str
    mesh: ShellMesh | SolidMesh
    R: Array
    origin: Array
    displacement: Array
    energy: Array
    von_mises: Array

    @property
    def positions(self) -> Array:
        """Nodes of the unloaded link in the base frame (k, 3) m."""
        return np.asarray(self.mesh.nodes @ self.R.T + self.origin)


@dataclass(frozen=True)
class ArmFields:
    """Fields of the whole arm under one load.

    ``displacement`` (6,) of the tool point, m and rad, base axes. ``links``: root to tip, then the crank.
    ``springs``: strain energy (J) of the joints' springs and the bar by the names of their parts, as in
    :func:`fem.statics.flexibility.deflection_by_part`; what is rigid has no entry.
    """

    displacement: Array
    links: tuple[LinkField, ...]
    springs: dict[str, float]

    @property
    def energy_by_part(self) -> dict[str, float]:
        """Strain energy of each part, J; their sum is half the work ``w . d`` of the load."""
        return {link.name: float(link.energy.sum()) for link in self.links} | self.springs


@dataclass(frozen=True)
class LinkShapes:
    """Unit-load solutions of a link: displacements (6k, 6(i-1)) of its mesh, root at rest, body's axes.

    ``matrices``: stiffness of a shell's elements by kind, (m, 18, 18) and (q, 24, 24), N/m, N, N m; none of a solid.
    """

    shapes: Array
    matrices: tuple[Array, ...]


def link_shapes(model: ArmModel, shells: Mapping[str, CoupledShell] | None = None) -> dict[str, LinkShapes]:
    """Unit-load solutions of all links by name: one factorisation each, whatever the poses, loads and springs.

    ``shells``: what :func:`fem.reference.shell_arm.couple_links` gave for these links, to save its work.

    Raises
    ------
    InputError
        The model has no links, or links that are not shells.
    """
    shells = couple_links(model) if shells is None else shells
    meshes = {link.name: mesh_of(link) for link in all_links(model)}
    return {
        name: LinkShapes(shells[name].modes()[0], element_stiffness(mesh) if isinstance(mesh, ShellMesh) else ())
        for name, mesh in meshes.items()
    }


def arm_fields(
    model: ArmModel,
    q: ArrayLike,
    wrench: ArrayLike,
    point: ArrayLike | None = None,
    *,
    shapes: Mapping[str, LinkShapes] | None = None,
) -> ArmFields:
    """Displacement, energy and stress fields of all links for one pose and one load.

    Parameters
    ----------
    model : built with ``links="shell"`` or ``"solid"``, either load path
    q : (dof,) rad; limits are not checked here
    wrench : (6,) force N, moment N m in base axes at the tool point
    point : (3,) m in the flange frame instead of the model's tool point
    shapes : what :func:`link_shapes` gave for these links, to save its work

    Raises
    ------
    InputError
        Shapes, values that are not finite, links that are not shells, or a flat parallelogram.

    Notes
    -----
    Equal to :func:`fem.reference.shell_arm.solve_shell_arm` to round-off. Stress: see :func:`face_stress`.
    """
    pose, loads, at = one_pose(model, q, wrench, point)
    if len(loads) != 1:
        raise InputError("loads of a field", code="B003", value=len(loads), allowed="one at a time")
    shapes = link_shapes(model) if shapes is None else shapes
    frames = forward_kinematics(model.robot, pose)
    tool = tool_position(model.robot, frames, at)
    w = poses_last(loads)
    carried, deformed, energy = {}, {}, {}
    for part in transfers(model, frames, pose, tool):
        s = part.carried(w)
        h = part.deformation(s)
        carried[part.name], deformed[part.name] = s[:, 0], h.ravel()
        energy[part.name] = 0.5 * float((s * h).sum())
    motions = _Motions(model, deformed)
    chain = build_chain(model, frames, pose, tool, motions)
    elbow = 0.0
    if chain.pins is not None:
        crank, pin = chain.pins
        # The elbow turns until the bar's pins are as far apart as its shortening says.
        apart = chain.span[0] / np.linalg.norm(chain.span[0]) @ (pin - crank)[:3]
        elbow = -(apart[0] + float(deformed.get("bar", np.zeros(1))[0])) / apart[1]
    whole = np.array([1.0, elbow])
    fields = []
    for link in all_links(model):
        root, R, origin = motions.links[link.name]
        fields.append(_link_field(link, shapes[link.name], carried[link.name], root @ whole, R, origin))
    springs = {name: value for name, value in energy.items() if name not in motions.links}
    return ArmFields(chain.tool @ whole, tuple(fields), springs)


@dataclass
class _Motions:
    """Builder of motions (6, 2) in base axes: by the parts' deformations, and by each rad that the elbow turns.

    ``links``: of their roots, with axes and origin of their bodies.
    """

    model: ArmModel
    deformed: Mapping[str, Array]
    links: dict[str, tuple[Array, Array, Array]] = field(default_factory=dict)

    def ground(self) -> Array:
        return np.zeros((6, 2))

    def carried(self, motion: Array, r: Array) -> Array:
        return np.asarray(rigid_motion(r)[0] @ motion)

    def sprung(self, motion: Array, springs: Springs) -> Array:
        if springs.where == "elbow":
            return np.asarray(motion + springs.turned[0] * BY_ELBOW)
        name = springs.where if springs.joint is None else self.model.joints[springs.joint].name
        behind = {
            "housing": " housing",
            "bearing": " other directions",
            "law": f" law {springs.directions.argmax() + 1}",
        }
        axes = springs.turned[0] if springs.where in ("axis", "law") else both(springs.R[0])
        give = axes @ self.deformed[name + behind.get(springs.where, "")]
        if springs.where == "bearing" and springs.joint is not None and self.model.joints[springs.joint].is_coupled:
            # The spring about the axis stands here too.
            give = give + axes[:, 5] * self.deformed.get(name, np.zeros(1))
        return np.asarray(motion + give[:, None] * BY_PARTS)

    def linked(self, link: LinkPart, root: Array, R: Array, origin: Array) -> dict[str, Array]:
        self.links[link.name] = root, R[0], origin[0]
        # A serial load path leaves the lever's pin without load.
        gives = self.deformed[link.name].reshape(-1, 6) @ both(R[0]).T
        ends = zip(link.element.interfaces[1:], link.element.points[1:] @ R[0].T, gives, strict=False)
        return {name: self.carried(root, r[None]) + give[:, None] * BY_PARTS for name, r, give in ends}


def _link_field(link: LinkPart, shape: LinkShapes, carried: Array, root: Array, R: Array, origin: Array) -> LinkField:
    mesh = mesh_of(link)
    # A serial load path leaves the lever's pin without load.
    local = (shape.shapes[:, : carried.size] @ carried).reshape(-1, 6)
    rigid = (rigid_motion(mesh.nodes @ R.T) @ root).reshape(-1, 6)
    if isinstance(mesh, ShellMesh):
        energy, stress = _energy(mesh, shape, local), von_mises(face_stress(mesh, local))
    else:
        local[:, 3:] = 0.0  # no freedoms: only the root's rest stands there
        energy = solid_energy(mesh, local[:, :3])
        stress = np.repeat(von_mises_solid(solid_stress(mesh, local[:, :3]))[:, None], 2, axis=1)
    return LinkField(
        name=link.name,
        mesh=mesh,
        R=R,
        origin=origin,
        displacement=rigid + (local.reshape(-1, 2, 3) @ R.T).reshape(-1, 6),
        energy=energy,
        von_mises=stress,
    )


def _energy(mesh: ShellMesh, shape: LinkShapes, displacement: Array) -> Array:
    """Strain energy (e,) J of the elements."""
    u = displacement.ravel()
    pairs = zip((mesh.triangles, mesh.quads), shape.matrices, strict=True)
    ends = [(u[freedoms(cells)].reshape(len(cells), K.shape[1]), K) for cells, K in pairs]
    return np.concatenate([0.5 * np.einsum("ei,eij,ej->e", v, K, v, optimize=True) for v, K in ends])


def face_stress(mesh: ShellMesh, displacement: Array) -> Array:
    """Plane stress (e, 2, 3) Pa on both faces in the middle of each element.

    ``displacement`` (k, 6) m and rad in the mesh's axes. Components xx, yy, xy in the element's axes: those of
    :func:`fem.elements.triangle.facet_axes` and :func:`fem.elements.quad.quad_frames`. First the face on the side of
    the normal, ``D (strain + t/2 curvature)``, then the other. Triangles: mean membrane strain, DKT curvature at
    the centroid. Quads: bilinear gradients at the centre, where QM6's incompatible modes vanish, of displacements
    carried to the mean plane. Transverse shear is left out. Facets do not see the shell's own curvature, and
    next to rigid rings, kinks and corners stress grows with refinement: read it two or three elements away.
    """
    strains = [_triangle_strains(mesh, displacement), _quad_strains(mesh, displacement)]
    strain, curvature = (np.concatenate(pair) for pair in zip(*strains, strict=True))
    bending = 0.5 * mesh.thickness[:, None] * curvature
    D = plane_stress(mesh.youngs_modulus, mesh.poissons_ratio)
    return np.asarray(np.stack([strain + bending, strain - bending], axis=1) @ D)


def von_mises(stress: Array) -> Array:
    """Von Mises stress (...) of plane stress (..., 3): ``sqrt(xx^2 - xx yy + yy^2 + 3 xy^2)``."""
    x, y, xy = np.moveaxis(stress, -1, 0)
    return np.asarray(np.sqrt(x**2 - x * y + y**2 + 3.0 * xy**2))


def _triangle_strains(mesh: ShellMesh, displacement: Array) -> tuple[Array, Array]:
    """Membrane strain and curvature (m, 3) of the triangles at their centroids."""
    axes, xy = facet_axes(mesh.triangle_corners)
    alpha = np.where(beside_quads(mesh), 0.0, ALPHA_B)
    mean, _ = membrane_strains(xy, 0.5 * np.linalg.det(xy[:, 1:] - xy[:, :1]), alpha)
    # Linear in the element: the mean over the three-point rule is the value at the centroid.
    bending = bending_curvatures(xy).mean(axis=1)
    v = (displacement[mesh.triangles].reshape(-1, 3, 2, 3) @ np.swapaxes(axes, 1, 2)[:, None]).reshape(-1, 3, 6)
    strain = np.einsum("escf,ecf->es", mean, v[..., [0, 1, 5]])
    return strain, np.einsum("escf,ecf->es", bending, v[..., [2, 3, 4]])


def _quad_strains(mesh: ShellMesh, displacement: Array) -> tuple[Array, Array]:
    """Membrane strain and curvature (q, 3) of the quads at their centres."""
    corners = mesh.quad_corners
    R = quad_frames(corners)
    local = (corners - corners.mean(axis=1, keepdims=True)) @ R
    v = (displacement[mesh.quads].reshape(-1, 4, 2, 3) @ R[:, None]).reshape(-1, 4, 6)
    height = local[..., 2]
    u = np.stack([v[..., 0] - height * v[..., 4], v[..., 1] + height * v[..., 3]], axis=2)
    slope = np.stack([v[..., 4], -v[..., 3]], axis=2)
    # Rows of the Jacobian: d(x, y) along the two reference directions.
    gradient = np.linalg.solve(_MIDDLE @ local[..., :2], np.broadcast_to(_MIDDLE, (len(corners), 2, 4)))
    return _symmetric(gradient @ u), _symmetric(gradient @ slope)


def _symmetric(gradient: Array) -> Array:
    """Components (xx, yy, twice xy) (e, 3) of gradients (e, 2, 2)."""
    return np.stack([gradient[:, 0, 0], gradient[:, 1, 1], gradient[:, 0, 1] + gradient[:, 1, 0]], axis=1)
