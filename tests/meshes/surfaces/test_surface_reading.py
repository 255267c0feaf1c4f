"""Surface files in any unit, axes and scene; a robot's shapes put together as they stand on its body."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import trimesh
from refusals import refuses
from rigid_frames import rigid_frame

from meshes.surfaces.bodies import body_surface, link_interfaces, surface_samples
from meshes.surfaces.reading import read_surface
from robots import load_robot
from robots.urdf.reading import Primitive, Visual

# A tetrahedron with a leg of 1, 2 and 3 along x, y and z.
CORNERS = np.array([[0.0, 0, 0], [1, 0, 0], [0, 2, 0], [0, 0, 3]])
FACES = np.array([[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]])
VOLUME = 1.0


def collada(unit: float, up: str | None, instances: str = '<instance_geometry url="#g"/>') -> str:
    numbers = " ".join(f"{v:g}" for v in CORNERS.ravel())
    triangles = " ".join(str(i) for i in FACES.ravel())
    axis = "" if up is None else f"<up_axis>{up}</up_axis>"
    return f"""<?xml version="1.0"?>
<COLLADA xmlns="http://www.collada.org/2005/11/COLLADASchema" version="1.4.1">
<asset><created>2024-01-01T00:00:00</created><modified>2024-01-01T00:00:00</modified>
<unit name="u" meter="{unit:g}"/>{axis}</asset>
<library_geometries><geometry id="g"><mesh>
<source id="p"><float_array id="a" count="12">{numbers}</float_array><technique_common>
<accessor source="#a" count="4" stride="3"><param name="X" type="float"/><param name="Y" type="float"/>
<param name="Z" type="float"/></accessor></technique_common></source>
<vertices id="v"><input semantic="POSITION" source="#p"/></vertices>
<triangles count="4"><input semantic="VERTEX" source="#v" offset="0"/><p>{triangles}</p></triangles>
</mesh></geometry></library_geometries>
<library_visual_scenes><visual_scene id="s"><node id="n">{instances}</node></visual_scene></library_visual_scenes>
<scene><instance_visual_scene url="#s"/></scene></COLLADA>
"""


def write(folder: Path, text: str) -> Path:
    path = folder / "part.dae"
    path.write_text(text, encoding="utf-8")
    return path


def enclosed(nodes: np.ndarray, faces: np.ndarray) -> float:
    return float(trimesh.Trimesh(nodes, faces, process=False).volume)


@pytest.mark.parametrize("unit", [1.0, 0.001, 0.0254])
def test_the_unit_of_a_dae_file_is_its_own(unit: float, tmp_path: Path) -> None:
    nodes, faces, notes = read_surface(write(tmp_path, collada(unit, "Z_UP")), None)
    np.testing.assert_allclose(nodes.max(axis=0), unit * CORNERS.max(axis=0))
    assert enclosed(nodes, faces) == pytest.approx(VOLUME * unit**3)
    assert "unit of the file from its header" in notes
    # What the user says comes first.
    given = read_surface(write(tmp_path, collada(unit, "Z_UP")), 0.01)[0]
    np.testing.assert_allclose(given.max(axis=0), 0.01 * CORNERS.max(axis=0))


@pytest.mark.parametrize(
    ("up", "extents", "note"),
    [
        ("Z_UP", [1, 2, 3], ""),
        (None, [1, 2, 3], ""),
        ("Y_UP", [1, 3, 2], "up axis of the file Y: turned to Z"),
        ("X_UP", [2, 3, 1], "up axis of the file X: turned to Z"),
    ],
)
def test_the_up_axis_of_a_dae_file_is_turned_to_z(up: str, extents: list[float], note: str, tmp_path: Path) -> None:
    path = write(tmp_path, collada(1.0, up))
    nodes, faces, notes = read_surface(path, None)
    np.testing.assert_allclose(np.ptp(nodes, axis=0), extents)
    assert enclosed(nodes, faces) == pytest.approx(VOLUME)  # turned, not mirrored
    if note:
        assert note in notes
        # The longest of the file's own up axis points up.
        up_corner = {"Y_UP": 2, "X_UP": 1}[str(up)]
        assert nodes[np.argmax(nodes[:, 2])] @ [0, 0, 1] == pytest.approx(CORNERS[up_corner].max())
        # Robot descriptions mean the coordinates as they stand.
        plain, _, said = read_surface(path, None, heed_up_axis=False)
        np.testing.assert_allclose(np.ptp(plain, axis=0), [1, 2, 3])
        assert any("not heeded" in line for line in said)


def test_a_scene_is_put_together_with_its_transforms(tmp_path: Path) -> None:
    twice = """<instance_geometry url="#g"/>
<node id="m"><matrix>0 -1 0 10  1 0 0 0  0 0 1 0  0 0 0 1</matrix><instance_geometry url="#g"/></node>"""
    nodes, faces, _ = read_surface(write(tmp_path, collada(0.001, "Z_UP", twice)), None)
    assert len(faces) == 8
    np.testing.assert_allclose(nodes.min(axis=0), [0.0, 0.0, 0.0], atol=1e-12)
    np.testing.assert_allclose(nodes.max(axis=0), [0.010, 0.002, 0.003])
    assert enclosed(nodes, faces) == pytest.approx(2e-9)


def stl(folder: Path) -> Path:
    path = folder / "part.stl"
    trimesh.Trimesh(CORNERS, FACES, process=False).export(path)
    return path


def test_shapes_of_a_body_are_scaled_moved_and_mirrored(tmp_path: Path) -> None:
    T = rigid_frame([5.0, 0, 0], [[0, -1, 0], [1, 0, 0], [0, 0, 1]])
    one = Visual(stl(tmp_path), np.array([0.1, 0.1, 0.1]), T)
    mirrored = Visual(stl(tmp_path), np.array([1.0, -1.0, 1.0]), np.eye(4))
    box = Visual(Primitive("box", (0.2, 0.4, 0.6)), np.ones(3), np.eye(4))
    surface = body_surface([one, mirrored, box])
    assert surface.sources == ("part.stl", "part.stl", "box")
    first, second, third = surface.faces[:4], surface.faces[4:8], surface.faces[8:]
    moved = surface.nodes[np.unique(first)]
    np.testing.assert_allclose(moved.min(axis=0), [5.0 - 0.2, 0.0, 0.0], atol=1e-7)
    np.testing.assert_allclose(moved.max(axis=0), [5.0, 0.1, 0.3], atol=1e-7)
    # Outward all: a mirrored shape with its faces as they were would enclose less than nothing.
    assert enclosed(surface.nodes, first) == pytest.approx(1e-3 * VOLUME, rel=1e-5)
    assert enclosed(surface.nodes, second) == pytest.approx(VOLUME)
    assert enclosed(surface.nodes, third) == pytest.approx(0.048)
    assert "coordinates multiplied by 1, -1, 1" in surface.notes


@pytest.mark.parametrize(
    ("solid", "volume"),
    [
        (Primitive("cylinder", (0.1, 0.5)), np.pi * 0.1**2 * 0.5),
        (Primitive("sphere", (0.1,)), 4 / 3 * np.pi * 0.1**3),
    ],
)
def test_primitives_are_solids(solid: Primitive, volume: float) -> None:
    surface = body_surface([Visual(solid, np.ones(3), np.eye(4))])
    assert enclosed(surface.nodes, surface.faces) == pytest.approx(volume, rel=0.01)  # 48 facets: 0.3 %


def test_scales_and_sizes_of_nothing_are_refused(tmp_path: Path) -> None:
    refuses("L001", "scale of", body_surface, [Visual(stl(tmp_path), np.array([1.0, 0.0, 1.0]), np.eye(4))])
    refuses("L001", "size of a box", body_surface, [Visual(Primitive("box", (0.1, 0.0, 0.1)), np.ones(3), np.eye(4))])


def test_interfaces_stand_at_the_joints_with_their_axes() -> None:
    robot = load_robot("tx200")
    upper_arm = 2
    there = link_interfaces(robot, upper_arm)
    np.testing.assert_allclose(there["root"].point, 0.0)
    np.testing.assert_allclose(np.linalg.norm(there["tip"].point), 0.95)
    np.testing.assert_allclose(np.abs(there["root"].axis @ there["tip"].axis), 1.0)
    assert link_interfaces(robot, 0)["root"].whole
    # The flange turns about the last joint's axis.
    last = link_interfaces(robot, robot.dof)
    np.testing.assert_allclose(last["tip"].axis, last["root"].axis)
    assert set(link_interfaces(load_robot("xr701"), 3)) == {"root", "tip", "pin"}


def test_neighbours_are_seen_from_the_link() -> None:
    robot = load_robot("tx200")
    here = link_interfaces(robot, 2, before=np.zeros((1, 3)), after=np.zeros((1, 3)))
    # The next body's origin is its joint; the one before has its origin where this joint's frame comes from.
    np.testing.assert_allclose(here["tip"].facing[0], here["tip"].point, atol=1e-12)
    T = robot.T_pre[1].copy()
    T[:3, :3] = T[:3, :3] @ robot.R_post[1]
    np.testing.assert_allclose(T[:3, :3] @ here["root"].facing[0] + T[:3, 3], 0.0, atol=1e-12)


def test_samples_cover_a_surface() -> None:
    surface = body_surface([Visual(Primitive("sphere", (0.1,)), np.ones(3), np.eye(4))])
    points = surface_samples(surface)
    directions = np.random.default_rng(0).normal(size=(50, 3))
    directions *= 0.1 / np.linalg.norm(directions, axis=1)[:, None]
    assert np.linalg.norm(directions[:, None] - points, axis=2).min(axis=1).max() < 0.35 / 100 * 2 * np.sqrt(3)


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize("corner", ["nan 0 0", "1e300 0 0", "-inf 1 1", "1e39 1e39 1e39"])
def test_corners_that_are_no_numbers_are_bad_input(corner: str, tmp_path: Path) -> None:
    normal = "facet normal 1e200 0 0\nouter loop\n"
    solid = f"solid x\n{normal}vertex 0 0 0\nvertex 1 0 0\nvertex {corner}\nendloop\nendfacet\nendsolid x\n"
    (tmp_path / "a.stl").write_text(solid, encoding="utf-8")
    refuses("L001", r"not finite numbers|cannot be read", read_surface, tmp_path / "a.stl", None)


def test_triangles_of_corners_that_are_not_there_are_bad_input(tmp_path: Path) -> None:
    mesh = trimesh.Trimesh(CORNERS, FACES, process=False)
    mesh.export(tmp_path / "a.ply", encoding="ascii")
    text = (tmp_path / "a.ply").read_text(encoding="utf-8")
    assert "3 1 2 3" in text
    assert len(read_surface(tmp_path / "a.ply", None)[1]) == 4
    (tmp_path / "a.ply").write_text(text.replace("3 1 2 3", "3 1 2 4"), encoding="utf-8")
    refuses("L001", "corners that are not there", read_surface, tmp_path / "a.ply", None)
