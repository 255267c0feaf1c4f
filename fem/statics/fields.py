"""Fields on shell links from the condensed path: displacements, strain energy and stress of one pose and load.

Statics says what each part carries (:mod:`fem.statics.transfers`); a link's unit-load shapes, solved once, turn that
into displacements of its mesh with its root at rest. The chain's kinematics adds the motion of the root: turns
of the joints, deformations of the links before, and with a parallelogram the elbow's turn, which the bar's
shortening decides. A pose costs a few dense products, no factorisation.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from fem.elements.assembly import beside_quads, element_stiffness, freedoms
from fem.elements.couplings import rigid_motion
from fem.elements.quad import quad_frames
from fem.elements.shell import CoupledShell
from fem.elements.triangle import (
    ALPHA_B,
    bending_curvatures,
    facet_axes,
    membrane_strains,
    plane_stress,
)
from fem.model import ArmModel, LinkPart
from fem.reference.shell_arm import all_links, both, couple_links, one_pose, shell_of
from fem.statics.transfers import transfers
from fem.statics.vectors import poses_last
from meshes import ShellMesh
from robots import InputError
from robots.arrays import Array
from robots.kinematics import BodyFrames, forward_kinematics, tool_position

# Gradients of the bilinear functions at the middle of (-1, 1)^2, by direction and corner.
_MIDDLE = 0.25 * np.array([[-1.0, 1.0, 1.0, -1.0], [-1.0, -1.0, 1.0, 1.0]])


@dataclass(frozen=True)
class LinkField:
    """One link's fields on its shell mesh (k nodes, e elements, triangles first).

    ``R`` (3, 3), ``origin`` (3,) m: the unloaded body's frame in the base frame. ``displacement`` (k, 6) m and
    rad, base axes, rigid-body motion included. ``energy`` (e,) J. ``von_mises`` (e, 2) Pa at the element's
    middle, on the face the normal points to (corners counterclockwise seen from there) and on the other one.
    """

    name: str
    mesh: ShellMesh
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

    ``matrices``: stiffness of its elements by kind, (m, 18, 18) and (q, 24, 24), N/m, N, N m.
    """

    shapes: Array
    matrices: tuple[Array, Array]


def link_shapes(model: ArmModel, shells: Mapping[str, CoupledShell] | None = None) -> dict[str, LinkShapes]:
    """Unit-load solutions of all links by name: one factorisation each, whatever the poses, loads and springs.

    ``shells``: what :func:`fem.reference.shell_arm.couple_links` gave for these links, to save its work.

    Raises
    ------
    InputError
        The model has no links, or links that are not shells.
    """
    shells = couple_links(model) if shells is None else shells
    return {
        link.name: LinkShapes(shells[link.name].modes()[0], element_stiffness(shell_of(link)))
        for link in all_links(model)
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
    model : built with ``links="shell"``, either load path
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
        raise InputError("loads of a field", value=len(loads), allowed="one at a time")
    shapes = link_shapes(model) if shapes is None else shapes
    frames = forward_kinematics(model.robot, pose)
    tool = tool_position(model.robot, frames, at)
    w = poses_last(loads)
    carried, deformed, energy = {}, {}, {}
    for part in transfers(model, frames, pose, tool):
        s = part.carried(w)
        h = part.deformation(s)
        carried[part.name], deformed[part.name] = s[:, 0], h[:, 0]
        energy[part.name] = 0.5 * float((s * h).sum())
    roots, end = _roots(model, frames, deformed, tool[0])
    fields = []
    for link in all_links(model):
        R, origin = frames.R[0, link.body], frames.p[0, link.body]
        if model.bar is not None and link is model.bar.crank and model.robot.parallelogram is not None:
            origin = frames.p[0, model.robot.parallelogram.crank_about + 1]
        fields.append(_link_field(link, shapes[link.name], carried[link.name], roots[link.name], R, origin))
    return ArmFields(end, tuple(fields), {name: value for name, value in energy.items() if name not in roots})


def _roots(
    model: ArmModel, frames: BodyFrames, deformed: Mapping[str, Array], tool: Array
) -> tuple[dict[str, Array], Array]:
    """Motion (6,) of each link's root and of the tool, base axes, from the parts' deformations."""
    robot = model.robot
    links = {link.body: link for link in model.links}
    p = robot.parallelogram if model.bar is not None else None
    R, origin, axis = frames.R[0], frames.p[0], frames.axis[0]
    motion, at, crank_pin = np.array(deformed.get("base", np.zeros(6))), np.zeros(3), np.zeros(6)
    roots: dict[str, Array] = {}
    for body in range(robot.dof + 1):
        if body > 0:
            joint, name = body - 1, model.joints[body - 1].name
            motion = _carry(motion, origin[body] - at)
            if p is not None and joint == p.crank_about:
                turn = _turn(axis[p.driven], deformed.get(model.joints[p.driven].name))
                crank_pin = _crank_pin(model, R[p.driven + 1], motion + turn, deformed, roots)
            tilt = deformed.get(f"{name} housing")
            if tilt is not None:
                motion = motion + both(R[joint] @ robot.T_pre[joint][:3, :3]) @ tilt
            if p is None or joint != p.driven:
                motion = motion + _turn(axis[joint], deformed.get(name))
            shift = deformed.get(f"{name} other directions")
            if shift is not None:
                motion = motion + both(R[body] @ robot.R_post[joint].T) @ shift
            for row, _ in model.joints[joint].laws:
                way = both(R[body] @ robot.R_post[joint].T)[:, row]
                motion = motion + way * float(np.squeeze(deformed[f"{name} law {row + 1}"]))
        link = links.get(body)
        own = None if link is None else both(R[body]) @ deformed[link.name].reshape(-1, 6).T
        if p is not None and body == p.driven + 1:
            rho = R[body] @ p.pin
            pin = _carry(motion, rho) + (0.0 if own is None or own.shape[1] < 2 else own[:, 1])
            span = origin[body] - origin[p.crank_about + 1]
            u = span / np.linalg.norm(span)
            shortening = deformed["bar"][0] if "bar" in deformed else 0.0
            # The elbow turns until the bar's pins are as far apart as its shortening says.
            elbow = (u @ (crank_pin - pin)[:3] - shortening) / (u @ np.cross(axis[p.driven], rho))
            motion = motion + _turn(axis[p.driven], np.array([elbow]))
        if link is not None:
            roots[link.name] = motion
        tip = frames.p_flange[0] if body == robot.dof else origin[body + 1]
        motion, at = _carry(motion, tip - origin[body]) + (0.0 if own is None else own[:, 0]), tip
    own = tool_position(robot, frames)[0]
    give = both(frames.R_flange[0]) @ deformed.get("tool", np.zeros(6))
    return roots, _carry(_carry(motion, own - at) + give, tool - own)


def _crank_pin(model: ArmModel, R: Array, root: Array, deformed: Mapping[str, Array], roots: dict[str, Array]) -> Array:
    assert model.bar is not None and model.robot.parallelogram is not None  # noqa: S101, PT018 - the caller knows
    pin = _carry(root, R @ model.robot.parallelogram.pin)
    if model.bar.crank is None:
        return pin
    name = model.bar.crank.name
    roots[name] = root
    return np.asarray(pin + both(R) @ deformed[name])


def _carry(motion: Array, r: Array) -> Array:
    """Motion (6,) of a point r (3,) m away on the same rigid body."""
    return np.asarray(rigid_motion(r[None])[0] @ motion)


def _turn(axis: Array, angle: Array | None) -> Array:
    return np.concatenate([np.zeros(3), axis * (0.0 if angle is None else angle[0])])


def _link_field(link: LinkPart, shape: LinkShapes, carried: Array, root: Array, R: Array, origin: Array) -> LinkField:
    mesh = shell_of(link)
    # A serial load path leaves the lever's pin without load.
    local = (shape.shapes[:, : carried.size] @ carried).reshape(-1, 6)
    rigid = (rigid_motion(mesh.nodes @ R.T) @ root).reshape(-1, 6)
    return LinkField(
        name=link.name,
        mesh=mesh,
        R=R,
        origin=origin,
        displacement=rigid + (local.reshape(-1, 2, 3) @ R.T).reshape(-1, 6),
        energy=_energy(mesh, shape, local),
        von_mises=von_mises(face_stress(mesh, local)),
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
