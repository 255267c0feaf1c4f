"""Solid meshes, their files, and surfaces of material itself."""

from __future__ import annotations

import importlib.util
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import trimesh
from refusals import refuses

from fem.elements.solid import solid_volume
from meshes import load_solid, save_solid
from meshes.solid_mesh import SolidMesh, least_jacobian, outer_faces, untangled
from meshes.solids.link import SolidSettings, import_solid, is_material
from meshes.solids.tetrahedra import in_surface, open_step
from meshes.surfaces.checks import SurfaceFault, material_surface, mean_wall
from meshes.surfaces.rings import Interface
from robots import InputError
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


# ------------------------------------------------------------
# Solids from STEP files and closed surfaces, by Netgen

occ = pytest.importorskip("netgen.occ", reason="needs the extra solid")

AXIS = np.array([1.0, 0.0, 0.0])
ENDS = {"root": Interface(np.zeros(3), AXIS), "tip": Interface(np.array([0.3, 0.0, 0.0]), AXIS)}
SETTINGS = SolidSettings(2.1e11, 0.3, 0.03)


@pytest.fixture(scope="module")
def step(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A round bar along x, 300 mm long, R30, in mm."""
    path = tmp_path_factory.mktemp("step") / "bar.step"
    occ.Cylinder(occ.Pnt(0, 0, 0), occ.X, 30, 300).WriteStep(str(path))
    return path


def volume(nodes: np.ndarray, cells: np.ndarray) -> float:
    return float(solid_volume(SolidMesh("part", nodes, cells, 1.0, 0.3, {}))[0].sum())


@pytest.mark.slow
def test_a_step_file_is_in_mm_and_its_seats_are_whole_faces(step: Path) -> None:
    done = import_solid(step, ENDS, SETTINGS)
    assert volume(done.mesh.nodes, done.mesh.tetrahedra) == pytest.approx(np.pi * 0.03**2 * 0.3, rel=5e-3)
    for name, x in (("root", 0.0), ("tip", 0.3)):
        face = np.flatnonzero(np.abs(done.mesh.nodes[:, 0] - x) < 1e-9)
        np.testing.assert_array_equal(np.sort(done.mesh.interfaces[name]), face)


def test_a_wrong_unit_is_refused(step: Path) -> None:
    refuses("L002", "scale of bar", import_solid, step, ENDS, SolidSettings(2.1e11, 0.3), scale=1.0)


@pytest.mark.slow
def test_a_seat_that_is_not_there_is_refused(step: Path) -> None:
    away = {"root": ENDS["root"], "tip": Interface(np.array([0.3, 0.4, 0.0]), AXIS)}
    with pytest.raises(InputError, match="interface tip"):
        import_solid(step, away, SETTINGS)


def test_several_solids_are_refused(tmp_path: Path) -> None:
    both = occ.Compound([occ.Box((0, 0, 0), (1, 1, 1)), occ.Box((3, 0, 0), (4, 1, 1))])
    both.WriteStep(str(tmp_path / "two.step"))
    caught = refuses("L008", "solids", open_step, tmp_path / "two.step")
    assert caught.value == 2


def test_what_is_no_step_file_is_refused(tmp_path: Path) -> None:
    (tmp_path / "no.step").write_text("nothing of the kind")
    refuses("L008", r"no\.step", open_step, tmp_path / "no.step")


@pytest.mark.slow
def test_a_surface_is_filled_up_to_its_curvature() -> None:
    ball = trimesh.creation.icosphere(subdivisions=3, radius=0.1)
    nodes, cells, _, _ = in_surface("ball", np.asarray(ball.vertices), np.asarray(ball.faces), 0.04)
    # Straight edges of 40 mm would lose 5 %.
    assert volume(nodes, cells) == pytest.approx(ball.volume, rel=0.01)


def test_without_netgen_it_says_what_to_install(monkeypatch: pytest.MonkeyPatch, step: Path) -> None:
    monkeypatch.setattr(importlib.util, "find_spec", lambda _: None)
    caught = refuses("F013", "netgen", open_step, step)
    assert "stiffarm[solid]" in str(caught)
