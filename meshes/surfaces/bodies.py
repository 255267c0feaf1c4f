"""Surfaces of a robot's bodies: the shapes of a description put together, and where joints hold them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import trimesh

from meshes.beams import body_axes, body_tip
from meshes.surfaces.distance_grid import sample
from meshes.surfaces.reading import read_surface
from meshes.surfaces.rings import Interface
from robots import InputError, Robot
from robots.arrays import Array, Integers
from robots.urdf.reading import Primitive, Visual

# Samples of a neighbour's surface, over its diagonal.
SAMPLE_SHARE = 1.0 / 100.0
FACETS = 48


@dataclass(frozen=True)
class BodySurface:
    """All shapes of a body in its frame: nodes (n, 3) m, faces (m, 3); ``sources``: file names or kinds."""

    nodes: Array
    faces: Integers
    sources: tuple[str, ...]
    notes: tuple[str, ...]


def body_surface(visuals: Sequence[Visual]) -> BodySurface:
    """Put a body's shapes together as they stand in its frame; mirrored ones get their faces turned.

    Raises
    ------
    InputError
        A file that cannot be read (see :func:`meshes.surfaces.reading.read_surface`), or a scale of zero.
    """
    nodes, faces, sources, notes = [], [], [], []
    count = 0
    for visual in visuals:
        own, cells, said = _shape(visual)
        if not (np.isfinite(visual.scale).all() and (visual.scale != 0.0).all()):
            raise InputError(
                f"scale of {said[0]}", code="L001", value=visual.scale.tolist(), allowed="three numbers other than 0"
            )
        if visual.scale.prod() < 0.0:
            cells = cells[:, ::-1]
        if (visual.scale != 1.0).any():
            said.append(f"coordinates multiplied by {', '.join(f'{v:g}' for v in visual.scale)}")
        T = visual.T_body_visual
        nodes.append((own * visual.scale) @ T[:3, :3].T + T[:3, 3])
        faces.append(cells + count)
        count += len(own)
        sources.append(visual.source.name if isinstance(visual.source, Path) else visual.source.kind)
        notes += said
    return BodySurface(np.vstack(nodes), np.vstack(faces), tuple(sources), tuple(notes))


def _shape(visual: Visual) -> tuple[Array, Integers, list[str]]:
    """Corners and faces of one shape in its own axes, and what was read."""
    if isinstance(visual.source, Path):
        return read_surface(visual.source, None, heed_up_axis=False)
    mesh = _primitive(visual.source)
    nodes, faces = np.asarray(mesh.vertices, dtype=np.float64), np.asarray(mesh.faces, dtype=np.int64)
    return nodes, faces, [f"a {visual.source.kind} of {', '.join(f'{v:g}' for v in visual.source.size)} m"]


def _primitive(solid: Primitive) -> Any:
    if not all(0.0 < value < np.inf for value in solid.size):
        raise InputError(f"size of a {solid.kind} (m)", code="L001", value=list(solid.size), allowed="greater than 0")
    if solid.kind == "box":
        return trimesh.creation.box(solid.size)
    if solid.kind == "cylinder":
        return trimesh.creation.cylinder(solid.size[0], solid.size[1], sections=FACETS)
    return trimesh.creation.icosphere(subdivisions=3, radius=solid.size[0])


def surface_samples(surface: BodySurface) -> Array:
    """Points (p, 3) spread over a body's surface, in its frame."""
    diagonal = float(np.linalg.norm(np.ptp(surface.nodes, axis=0)))
    return sample(surface.nodes[surface.faces], SAMPLE_SHARE * diagonal)


def link_interfaces(
    robot: Robot, body: int, before: Array | None = None, after: Array | None = None
) -> dict[str, Interface]:
    """Where a body is held: ``root`` at its own joint and ``tip`` at the next one or the flange, in its frame.

    ``before``, ``after`` (p, 3): points on the surfaces of the bodies before and after it, each in its own frame;
    with the joints at zero their places are near enough, as a joint's seat is round. The base stands on its whole
    foot, at right angles to the first axis; the flange has the last joint's axis, since frames of flanges follow
    no rule. The body that a parallelogram drives has a ``pin`` too, across whose bore the driven axis stands.
    """
    n = robot.dof
    R, p = (
        robot.T_pre[:, :3, :3] @ robot.R_post,
        robot.T_pre[:, :3, 3],
    )  # of each body in the one before, joints at zero
    own_axis, next_axis = body_axes(robot, body).values()
    facing_root = None if before is None or body == 0 else (before - p[body - 1]) @ R[body - 1]
    facing_tip = None if after is None or body == n else after @ R[body].T + p[body]
    interfaces = {
        "root": Interface(np.zeros(3), own_axis, facing_root, whole=body == 0),
        "tip": Interface(body_tip(robot, body), next_axis, facing_tip),
    }
    if robot.parallelogram is not None and body == robot.parallelogram.driven + 1:
        interfaces["pin"] = Interface(robot.parallelogram.pin, own_axis)
    return interfaces
