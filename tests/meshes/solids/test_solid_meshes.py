"""Solid meshes, their files, and surfaces of material itself."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import trimesh
from refusals import refuses

from meshes import load_solid, save_solid
from meshes.solid_mesh import least_jacobian, outer_faces, untangled
from meshes.solids.link import is_material
from meshes.surfaces.checks import SurfaceFault, material_surface, mean_wall
from robots.arrays import Array, Integers
from tests.fem.solid_bars import bar

Surface = tuple[Array, Integers]


def box(size: tuple[float, float, float], at: tuple[float, float, float] = (0.0, 0.0, 0.0)) -> Surface:
    mesh = trimesh.creation.box(size)
    return np.asarray(mesh.vertices) + at, np.asarray(mesh.faces)


def together(*surfaces: Surface) -> Surface:
    first = np.cumsum([0, *(len(nodes) for nodes, _ in surfaces)])
    return np.vstack([nodes for nodes, _ in surfaces]), np.vstack(
        [faces + start for (_, faces), start in zip(surfaces, first, strict=False)]
    )


def hollow() -> Surface:
    """Box tube with end plates, wall 8 mm."""
    nodes, faces = box((0.784, 0.134, 0.184))
    return together(box((0.8, 0.15, 0.2)), (nodes, faces[:, ::-1]))


def test_the_skin_of_a_bar_faces_outward() -> None:
    mesh = bar(0.5, 0.05, 3, 2)
    faces, owner = outer_faces(mesh.tetrahedra)
    a, b, c = (mesh.nodes[faces[:, i]] for i in range(3))
    normal = 0.5 * np.cross(b - a, c - a)
    assert np.linalg.norm(normal, axis=1).sum() == pytest.approx(4 * 0.5 * 0.05 + 2 * 0.05**2)
    assert (a * normal).sum() / 3.0 == pytest.approx(0.5 * 0.05**2)
    np.testing.assert_allclose(mesh.nodes[faces[:, 3:]], 0.5 * np.stack([a + b, b + c, c + a], axis=1), atol=1e-15)
    assert all(np.isin(face, mesh.tetrahedra[cell]).all() for face, cell in zip(faces, owner, strict=True))


def test_elements_that_curved_edges_turn_inside_out_get_straight_ones() -> None:
    mesh = bar(0.5, 0.05, 3, 1)
    assert least_jacobian(mesh.nodes, mesh.tetrahedra) == pytest.approx(np.ones(len(mesh.tetrahedra)))
    bent = mesh.nodes.copy()
    bent[mesh.tetrahedra[0, 4]] += 0.05
    assert least_jacobian(bent, mesh.tetrahedra).min() < 0.0
    mended = untangled(bent, mesh.tetrahedra)
    assert least_jacobian(mended, mesh.tetrahedra).min() >= 0.2
    assert np.abs(mended - mesh.nodes).max() < 0.01


def test_a_solid_is_read_back_as_it_was(tmp_path: Path) -> None:
    mesh = bar(0.5, 0.05, 2, 1)
    sha256 = save_solid(mesh, tmp_path / "bar.npz")
    back = load_solid(tmp_path / "bar.npz", sha256, "other")
    assert back.name == "other"
    np.testing.assert_array_equal(back.tetrahedra, mesh.tetrahedra)
    np.testing.assert_array_equal(back.interfaces["tip"], mesh.interfaces["tip"])
    refuses("F007", "SHA-256", load_solid, tmp_path / "bar.npz", "0" * 64)


def test_unused_nodes_are_refused() -> None:
    mesh = bar(0.5, 0.05, 2, 1)
    refuses("L007", "belong to no element", replace, mesh, nodes=np.vstack([mesh.nodes, np.ones(3)]))


def test_hollows_face_inward_and_are_no_bodies() -> None:
    nodes, faces = hollow()
    # As some programs write them: everything the other way round.
    turned, cells, _ = material_surface("tube", nodes, faces[:, ::-1])
    corners = turned[cells]
    volume = np.einsum("ij,ij->i", corners[:, 0], np.cross(corners[:, 1], corners[:, 2])).sum() / 6.0
    assert volume == pytest.approx(0.8 * 0.15 * 0.2 - 0.784 * 0.134 * 0.184)


def test_a_wall_is_told_from_what_it_encloses() -> None:
    assert mean_wall(*hollow())[0] == pytest.approx(0.008, rel=0.05)
    assert is_material(*hollow())
    assert not is_material(*box((0.8, 0.15, 0.2)))
    assert not is_material(*box((0.8, 0.05, 0.05)))


@pytest.mark.parametrize(
    ("surface", "what"),
    [
        (together(box((0.1, 0.1, 0.1)), box((0.1, 0.1, 0.1), (0.3, 0.0, 0.0))), "separate bodies"),
        (together(box((0.1, 0.1, 0.1)), box((0.1, 0.1, 0.1), (0.1, 0.1, 0.0))), "not manifold"),
        ((box((0.1, 0.1, 0.1))[0], box((0.1, 0.1, 0.1))[1][1:]), "open"),
    ],
    ids=["two bodies", "two boxes on one edge", "a face lost"],
)
def test_what_is_no_single_solid_is_refused(surface: Surface, what: str) -> None:
    with pytest.raises(SurfaceFault, match=what):
        material_surface("part", *surface)
