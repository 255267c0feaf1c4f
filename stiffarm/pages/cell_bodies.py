"""Surfaces of everything in a cell, for pictures and for pages that draw it: triangles in the bodies' frames."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
import pyvista as pv
import trimesh

from machining.cell import Scene, Solid
from machining.cell.scene import ARM, CARRIAGE, CUTTER, FIXED, HOLDER, PART
from robots.arrays import Array, Integers
from stiffarm.pages.parts import chain_data, column_matrix, packed

KIND_NAMES = {ARM: "arm", HOLDER: "holder", CUTTER: "cutter", CARRIAGE: "carriage", FIXED: "fixture", PART: "part"}
TOOL_KINDS = (KIND_NAMES[HOLDER], KIND_NAMES[CUTTER])
# Most triangles of one body; closed surfaces with more are thinned out, hulls are small anyway.
MOST_TRIANGLES = 6000

# Has no type hints.
_creation: Any = trimesh.creation


class BodySurface(NamedTuple):
    """A body: name, kind (a value of ``KIND_NAMES``), number of its frame in ``Scene.frames``, triangles in m."""

    name: str
    kind: str
    frame: int
    vertices: Array
    triangles: Integers


def body_surfaces(scene: Scene, most: int = MOST_TRIANGLES) -> list[BodySurface]:
    """Surfaces of all bodies of a scene, each with at most about ``most`` triangles.

    Rounded hulls are drawn with their rounding; surfaces that stand for thick walls without their thickness.
    """
    out = []
    for member in scene.members:
        meshes = [_mesh(solid, most // len(member.body.solids)) for solid in member.body.solids]
        first = np.cumsum([0, *(len(nodes) for nodes, _ in meshes[:-1])])
        vertices = np.concatenate([nodes for nodes, _ in meshes])
        triangles = np.concatenate([faces + start for (_, faces), start in zip(meshes, first, strict=True)])
        out.append(BodySurface(member.body.name, KIND_NAMES[member.kind], member.frame, vertices, triangles))
    return out


def _mesh(solid: Solid, most: int) -> tuple[Array, Integers]:
    nodes, faces = solid.nodes, solid.faces
    if solid.convex and solid.radius > 0.0:
        ball = np.asarray(_creation.icosphere(subdivisions=2, radius=solid.radius).vertices)
        around = trimesh.convex.convex_hull((nodes[:, None] + ball).reshape(-1, 3))
        nodes, faces = np.asarray(around.vertices), np.asarray(around.faces)
    if len(faces) > most:
        numbers: Any = faces
        thin = pv.PolyData.from_regular_faces(nodes, numbers).decimate(1.0 - most / len(faces))
        nodes, faces = np.asarray(thin.points), np.asarray(thin.regular_faces)
    return np.asarray(nodes, dtype=np.float64), np.asarray(faces, dtype=np.int64)


def placed_in_world(scene: Scene, surfaces: list[BodySurface], q: Array, travel: Array, table: float) -> list[Array]:
    """Vertices (k, 3) m of the surfaces in the world, at a pose q (dof,) rad, travel (k,) m and table rad."""
    R, p = (x[0] for x in scene.frames(q[None], travel[None], np.array([table])))
    base = scene.cell.T_world_base(travel[None])[0]
    placed = []
    for body in surfaces:
        x = body.vertices @ R[body.frame].T + p[body.frame]
        placed.append(x @ base[:3, :3].T + base[:3, 3])
    return placed


def cell_data(scene: Scene, most: int, others: Sequence[Scene] = ()) -> dict[str, Any]:
    """Arm and cell for ``cellScene`` of ``shop_scene.js``, with about ``most`` triangles in all.

    ``others``: the same with other tools; a tool's bodies bear its place, 0 for that of ``scene``, then theirs.
    """
    cell, every = scene.cell, (scene, *others)
    share = most // max(1, sum(len(one.members) for one in every))
    drawn = [
        (body, place)
        for place, one in enumerate(every)
        for body in body_surfaces(one, share)
        if place == 0 or body.kind in TOOL_KINDS
    ]
    return {
        "chain": chain_data(scene.arm.robot),
        "cell": {
            "base": column_matrix(cell.T_world_base0),
            "part": column_matrix(cell.T_world_part0),
            "tools": [column_matrix(one.cell.tool.T_flange_tool) for one in every],
            "rails": [axis.direction.tolist() for axis in cell.linear_axes],
            "table": None
            if cell.turntable is None
            else {"point": cell.turntable.point.tolist(), "axis": cell.turntable.axis.tolist()},
            "floor": cell.floor,
        },
        "frames": scene.arm.count,
        "bodies": [
            {
                "name": body.name,
                "kind": body.kind,
                "frame": int(body.frame),
                "v": packed(body.vertices, "<f4"),
                "t": packed(body.triangles, "<u4"),
                "tool": place if body.kind in TOOL_KINDS else None,
            }
            for body, place in drawn
        ],
    }
