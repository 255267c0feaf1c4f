"""Openings and rims of casings: where they are, that the mesh stays whole, what they do, what is refused."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise
from typing import NamedTuple

import numpy as np
import pytest
from refusals import refuses

from fem.elements import beam as fem_beam
from fem.elements.condensation import condense
from fem.elements.shell import shell_superelement
from meshes import BeamMesh, ShellMesh, casing_mesh, casing_size, crank_beam_mesh, link_beam_mesh
from robots import bundled_names, load_description
from robots.arrays import Array, Integers
from robots.robot import robot_from
from robots.schema.description import Opening, Rim
from robots.schema.quantities import PositiveLength

WIDTH, HEIGHT, WALL, LENGTH = 0.24, 0.16, 0.008, 1.0
# Mid-surface.
WIDE, HIGH = WIDTH - WALL, HEIGHT - WALL


def _beam(path: list[list[float]], end: tuple[float, float] = (WIDTH, HEIGHT)) -> BeamMesh:
    """Box along a polyline with four elements a segment, height along global z, tapering to another size."""
    corners = np.array(path)
    along = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(corners, axis=0), axis=1))])
    at = np.unique(np.concatenate([np.linspace(a, b, 5) for a, b in pairwise(along)]))
    nodes = np.stack([np.interp(at, along, corners[:, k]) for k in range(3)], axis=1)
    share = at[:, None] / along[-1]
    sections = np.array([WIDTH, HEIGHT, WALL]) * (1.0 - share) + np.array([*end, WALL]) * share
    n = len(nodes) - 1
    return BeamMesh(
        name="box",
        nodes=nodes,
        elements=np.stack([np.arange(n), np.arange(1, n + 1)], axis=1),
        kind="box",
        dimensions=np.stack([sections[:-1], sections[1:]], axis=1),
        up=np.array([0.0, 0.0, 1.0]),
        youngs_modulus=210e9,
        poissons_ratio=0.3,
        interfaces={"root": 0, "tip": n},
    )


# Along x, so that the section's y and z are the global ones.
STRAIGHT = _beam([[0, 0, 0], [LENGTH, 0, 0]])
TAPERED = _beam([[0, 0, 0], [LENGTH, 0, 0]], end=(0.18, 0.12))
ELBOW = _beam([[0, 0, 0], [0.5, 0, 0], [0.5, 0.5, 0]])


def _opening(side: str, along: tuple[float, float], across: tuple[float, float]) -> Opening:
    return Opening(side=side, along=along, across=across, source="assumed")  # type: ignore[arg-type]


def _rim(length_mm: float, wall_mm: float) -> Rim:
    length, wall = (PositiveLength(value=v, unit="mm", source="assumed") for v in (length_mm, wall_mm))
    return Rim(length=length, wall=wall)


def _areas(mesh: ShellMesh) -> Array:
    a, b, c, d = np.moveaxis(mesh.quad_corners, 1, 0)
    return np.asarray(0.5 * np.linalg.norm(np.cross(c - a, d - b), axis=1))


def _free_edges(mesh: ShellMesh) -> Integers:
    """Edges of one element only; asserts that no edge has more than two."""
    edges, count = np.unique(np.sort(mesh.edges, axis=1), axis=0, return_counts=True)
    assert count.max() <= 2
    return np.asarray(edges[count == 1])


def _inner_free_edges(mesh: ShellMesh) -> Integers:
    """Free edges that are not an interface's."""
    free = _free_edges(mesh)
    return free[~np.isin(free, np.concatenate(list(mesh.interfaces.values()))).all(axis=1)]


# Corners of the opening along (0.3, 0.55) across (0.2, 0.6) of a wall, as (x, along the wall's own direction).
SPOTS = {
    "+y": lambda u: (0.5 * WIDE, HIGH * (u - 0.5)),
    "-y": lambda u: (-0.5 * WIDE, HIGH * (u - 0.5)),
    "+z": lambda u: (WIDE * (u - 0.5), 0.5 * HIGH),
    "-z": lambda u: (WIDE * (u - 0.5), -0.5 * HIGH),
}


@pytest.mark.parametrize("side", SPOTS)
def test_an_opening_is_where_it_was_asked_for(side: str) -> None:
    mesh = casing_mesh(STRAIGHT, openings=[_opening(side, (0.3, 0.55), (0.2, 0.6))])
    edges = _inner_free_edges(mesh)
    points = mesh.nodes[np.unique(edges)]
    corners = [(x, *SPOTS[side](u)) for x in (0.3, 0.55) for u in (0.2, 0.6)]
    # Exact but for round-off: element lines lie on the edges.
    np.testing.assert_allclose(points.min(axis=0), np.min(corners, axis=0), atol=1e-12)
    np.testing.assert_allclose(points.max(axis=0), np.max(corners, axis=0), atol=1e-12)
    # No staircase: the free edges are the rectangle's perimeter.
    length = np.linalg.norm(mesh.nodes[edges[:, 1]] - mesh.nodes[edges[:, 0]], axis=1).sum()
    wall = HIGH if side in ("+y", "-y") else WIDE
    assert length == pytest.approx(2.0 * (0.25 + 0.4 * wall), rel=1e-12)


def test_openings_take_their_area_and_nothing_else() -> None:
    openings = [_opening("+y", (0.2, 0.4), (0.3, 0.7)), _opening("-z", (0.33, 0.6), (0.1, 0.5))]
    openings += [_opening("+y", (0.5, 0.8), (0.2, 0.8))]
    area = _areas(casing_mesh(STRAIGHT, openings=openings)).sum()
    holes = 0.2 * 0.4 * HIGH + 0.27 * 0.4 * WIDE + 0.3 * 0.6 * HIGH
    assert area == pytest.approx(2.0 * (WIDE + HIGH) * LENGTH - holes, rel=1e-12)


def test_an_opening_of_a_tapered_wall_is_a_share_of_it() -> None:
    area = _areas(casing_mesh(TAPERED, openings=[_opening("+z", (0.4, 0.6), (0.3, 0.7))])).sum()
    # The wall's width is linear along the link: (0.232 + 0.172) / 2 at the middle; its slope makes it longer.
    slope = np.hypot(1.0, 0.5 * (0.16 - 0.12))
    expected = _areas(casing_mesh(TAPERED)).sum() - 0.2 * slope * 0.4 * 0.5 * (0.232 + 0.172)
    assert area == pytest.approx(expected, rel=1e-12)


@pytest.mark.parametrize("beam", [STRAIGHT, TAPERED, ELBOW], ids=["straight", "tapered", "elbow"])
@pytest.mark.parametrize("size", [None, 0.013, 0.2])
def test_the_mesh_stays_whole_and_without_slivers(beam: BeamMesh, size: float | None) -> None:
    openings = [_opening("+y", (0.12, 0.3), (0.2, 0.45)), _opening("-z", (0.2, 0.35), (0.4, 0.9))]
    openings += [_opening("+y", (0.7, 0.85), (0.3, 0.6))]
    mesh = casing_mesh(beam, size, openings=openings, rim=_rim(60.0, 16.0))
    # ShellMesh itself refuses loose nodes and folded quads. Rings are closed and no edge is torn but the holes'.
    for ring in mesh.interfaces.values():
        rim = _free_edges(mesh)
        on_ring = rim[np.isin(rim, ring).all(axis=1)]
        np.testing.assert_array_equal(np.bincount(on_ring.ravel(), minlength=len(mesh.nodes))[ring], 2)
    corners = mesh.nodes[np.unique(_inner_free_edges(mesh), return_counts=True)[0]]
    assert len(corners) >= 3 * 8  # at least two elements across each side of the three openings
    sides = np.linalg.norm(np.roll(mesh.quad_corners, -1, axis=1) - mesh.quad_corners, axis=2)
    # Strips of one wall's thickness at worst: the size asked for over the wall, and 10 in the mitre's inner corner.
    aimed = 2.0 * (WIDE + HIGH) / 48 if size is None else size
    assert (sides.max(axis=1) / sides.min(axis=1)).max() < max(10.0, 1.5 * aimed / WALL)


def test_next_to_a_kink_openings_and_rims_stay_at_right_angles() -> None:
    mesh = casing_mesh(ELBOW, openings=[_opening("+z", (0.7, 0.85), (0.25, 0.75))], rim=_rim(80.0, 16.0))
    hole = mesh.nodes[np.unique(_inner_free_edges(mesh))]
    # Second run: along global y from (0.5, 0); the section's width lies along -x.
    expected = [[0.5 - 0.25 * WIDE, 0.2, 0.5 * HIGH], [0.5 + 0.25 * WIDE, 0.35, 0.5 * HIGH]]
    np.testing.assert_allclose([hole.min(axis=0), hole.max(axis=0)], expected, atol=1e-12)
    thick = mesh.quad_corners[mesh.thickness == 0.016].reshape(-1, 3)
    # The rims end in planes across the centre line, inside and outside of the bend alike.
    root, tip = thick[thick[:, 0] < 0.1], thick[thick[:, 1] > 0.3]
    assert len(root) + len(tip) == len(thick)
    np.testing.assert_allclose(np.unique(np.round(root[:, 0], 12))[[0, -1]], [0.0, 0.08], atol=1e-12)
    np.testing.assert_allclose(np.unique(np.round(tip[:, 1], 12))[[0, -1]], [0.42, 0.5], atol=1e-12)


def test_rims_are_thick_over_their_length_and_thin_beyond() -> None:
    mesh = casing_mesh(STRAIGHT, rim=_rim(50.0, 20.0))
    x = mesh.quad_corners[:, :, 0]
    in_rim = (x.max(axis=1) < 0.05 + 1e-9) | (x.min(axis=1) > 0.95 - 1e-9)
    np.testing.assert_array_equal(mesh.thickness, np.where(in_rim, 0.020, WALL))
    # Mid-surface and ends are those of the casing without rims.
    assert _areas(mesh).sum() == pytest.approx(2.0 * (WIDE + HIGH), rel=1e-12)
    assert _areas(mesh)[in_rim].sum() == pytest.approx(2.0 * (WIDE + HIGH) * 0.1, rel=1e-12)


def test_without_openings_and_rims_the_grid_is_even() -> None:
    mesh = casing_mesh(STRAIGHT)
    size = 2.0 * (WIDE + HIGH) / 32
    rows = int(np.ceil(1.0 / size))
    around = 2 * int(np.ceil(WIDE / size)) + 2 * int(np.ceil(HIGH / size))
    assert mesh.nodes.shape == ((rows + 1) * around, 3)
    # To the last bit: models calibrated with shell links must not move.
    np.testing.assert_array_equal(mesh.nodes[::around, 0], np.linspace(0.0, 1.0, rows + 1))
    empty = casing_mesh(STRAIGHT, size, openings=[], rim=None)
    np.testing.assert_array_equal(mesh.nodes, empty.nodes)


def _flexibility(openings: list[Opening], rim: Rim | None = None, beam: BeamMesh = STRAIGHT) -> Array:
    mesh = casing_mesh(beam, 0.03, openings=openings, rim=rim)
    return shell_superelement(mesh, beam.interface_points).flexibility


def test_long_windows_bend_as_the_section_that_is_left() -> None:
    beam = _beam([[0, 0, 0], [2.0, 0, 0]])
    long, short = ([_opening(s, (0.5 - w, 0.5 + w), (0.25, 0.75)) for s in ("+z", "-z")] for w in (0.25, 0.125))
    # From the short to the long windows, 0.5 m of beam loses half of both flanges. Under a pure moment about y
    # the ends of the windows, which are the same in both, drop out of the difference.
    added = (_flexibility(long, beam=beam) - _flexibility(short, beam=beam))[4, 4]
    full = 2.0 * (WIDE * WALL * (0.5 * HIGH) ** 2 + WALL * HIGH**3 / 12.0)
    left = full - 2.0 * (0.5 * WIDE * WALL * (0.5 * HIGH) ** 2)
    # 1 %: thin-wall section constants (the flanges' own bending), measured 0.5 %.
    assert added == pytest.approx(0.5 / 210e9 * (1.0 / left - 1.0 / full), rel=0.01)


def test_openings_on_opposite_walls_are_mirror_images() -> None:
    plus, minus = (_flexibility([_opening(side, (0.2, 0.4), (0.3, 0.6))]) for side in ("+y", "-y"))
    mirror = np.array([1.0, -1.0, 1.0, -1.0, 1.0, -1.0])  # y and the rotations about x and z change sign
    scale = np.sqrt(np.outer(np.diag(plus), np.diag(plus)))
    # Round-off of the solution.
    assert (np.abs(plus - mirror[:, None] * minus * mirror) / scale).max() < 1e-9


def test_openings_soften_and_rims_stiffen() -> None:
    plain, rimmed = np.diag(_flexibility([])), np.diag(_flexibility([], _rim(50.0, 20.0)))
    opened = np.diag(_flexibility([_opening("+y", (0.3, 0.6), (0.2, 0.8))]))
    assert (rimmed < plain).all()
    assert (opened > plain).all()
    # Torsion suffers most: the shear flow has to pass the opening by bending its edges.
    assert np.argmax(opened / plain) == 3


REFUSED = {
    "overlap": (
        [("+y", (0.2, 0.5), (0.2, 0.5)), ("+y", (0.4, 0.6), (0.4, 0.6))],
        None,
        "opening 1 .* opening 2 .* overlap",
    ),
    "touching corners": ([("+y", (0.2, 0.4), (0.2, 0.5)), ("+y", (0.4, 0.6), (0.5, 0.8))], None, "overlap or touch"),
    "into the rim": ([("+z", (0.03, 0.4), (0.2, 0.5))], (50.0, 16.0), r"reaches into a rim.*from 0\.05 to 0\.95"),
    "into the interface's row": ([("+z", (0.001, 0.4), (0.2, 0.5))], None, "the root and opening 1"),
    "at the corner": ([("+z", (0.2, 0.4), (0.2, 0.99))], None, "opening 1 .* the edge of the wall"),
    "almost in line": ([("+y", (0.2, 0.4), (0.2, 0.5)), ("-y", (0.203, 0.4), (0.2, 0.5))], None, "same share"),
    "long rims": ([], (501.0, 16.0), "half of the centre line"),
    "thin rims": ([], (50.0, 4.0), "wall of the rims"),
    "rims that fill the link": ([], (50.0, 200.0), "wall of the rims"),
    "short rims": ([], (5.0, 16.0), "the root and the rim"),
}


@pytest.mark.parametrize("case", REFUSED)
def test_what_cannot_be_meshed_is_refused(case: str) -> None:
    openings, rim, message = REFUSED[case]
    refuses(
        "L009",
        message,
        casing_mesh,
        STRAIGHT,
        openings=[_opening(*o) for o in openings],
        rim=None if rim is None else _rim(*rim),
    )


def test_an_opening_in_the_mitre_is_refused_with_the_room_it_needs() -> None:
    caught = refuses("L009", r"kink.*opening 1", casing_mesh, ELBOW, openings=[_opening("+z", (0.55, 0.7), (0.3, 0.6))])
    # Half of the width at 45 deg, and a wall: 0.116 + 0.008 of 1 m.
    assert "0.124 apart" in str(caught)
    casing_mesh(ELBOW, openings=[_opening("+z", (0.625, 0.7), (0.3, 0.6))])


def test_all_faults_are_told_at_once() -> None:
    refuses(
        "L009",
        "2 problem",
        casing_mesh,
        STRAIGHT,
        openings=[_opening("+z", (0.01, 0.3), (0.2, 0.5)), _opening("+z", (0.2, 0.5), (0.3, 0.6))],
        rim=_rim(50.0, 16.0),
    )


@pytest.mark.parametrize("size", [0.0, -0.01, np.nan, np.inf])
def test_a_size_that_is_none_is_refused(size: float) -> None:
    refuses("L009", "element size", casing_mesh, STRAIGHT, size)


# ------------------------------------------------------------
# casings


class Casing(NamedTuple):
    """A bundled casing: its beam, and what its shell has beside it."""

    beam: BeamMesh
    openings: tuple[Opening, ...] = ()
    rim: Rim | None = None

    def mesh(self, refined: int = 1) -> ShellMesh:
        size = casing_size(self.beam, self.openings) / refined
        return casing_mesh(self.beam, size, openings=self.openings, rim=self.rim)


def _casings() -> list[Casing]:
    out = []
    for name in bundled_names():
        description = load_description(name)
        robot = robot_from(description)
        out += [Casing(link_beam_mesh(description, robot, link), link.opening, link.rim) for link in description.link]
        if robot.parallelogram is not None:
            out.append(Casing(crank_beam_mesh(description, robot)))
    return out


CASINGS = _casings()


def _straight(kind: str, dimensions: list[float], length: float = 1.0) -> BeamMesh:
    nodes = np.array([[0.0, 0.0, z] for z in np.linspace(0.0, length, 5)])
    return BeamMesh(
        name="test tube",
        nodes=nodes,
        elements=np.stack([np.arange(4), np.arange(1, 5)], axis=1),
        kind=kind,  # type: ignore[arg-type]
        dimensions=np.tile(np.array(dimensions), (4, 2, 1)),
        up=np.array([1.0, 0.0, 0.0]),
        youngs_modulus=210e9,
        poissons_ratio=0.3,
        interfaces={"root": 0, "tip": 4},
    )


def _diagonals(beam: BeamMesh, size: float | None = None) -> tuple[np.ndarray, np.ndarray]:  # type: ignore[type-arg]
    shell = shell_superelement(casing_mesh(beam, size), beam.interface_points)
    nodes = np.array(list(beam.interfaces.values()))
    line = condense(beam.name, tuple(beam.interfaces), beam.interface_points, fem_beam.assemble(beam), nodes)
    return np.diag(shell.flexibility), np.diag(line.flexibility)


def test_area_and_mass_of_a_box_casing() -> None:
    mesh = casing_mesh(_straight("box", [0.3, 0.2, 0.008]))
    a, b, c, d = (mesh.quad_corners[:, i] for i in range(4))
    area = 0.5 * np.linalg.norm(np.cross(c - a, d - b), axis=1)
    # Mid-surface perimeter times length; a straight sweep is exact but for round-off.
    assert area.sum() == pytest.approx(2.0 * (0.292 + 0.192) * 1.0, rel=1e-12)
    assert (area * mesh.thickness).sum() == pytest.approx(2.0 * (0.292 + 0.192) * 0.008, rel=1e-12)


def test_rings_stand_on_the_interfaces() -> None:
    for casing in CASINGS:
        mesh = casing.mesh()
        assert list(mesh.interfaces) == list(casing.beam.interfaces)
        for ring, point in zip(mesh.interfaces.values(), casing.beam.interface_points, strict=True):
            # The middle of a ring's box is its centre: exact for boxes and for tubes of 4n elements around.
            corners = mesh.nodes[ring].min(axis=0), mesh.nodes[ring].max(axis=0)
            np.testing.assert_allclose(np.mean(corners, axis=0), point, atol=1e-9)


def test_long_box_tube_agrees_with_timoshenko() -> None:
    shell, line = _diagonals(_straight("box", [0.3, 0.3, 0.008]), size=0.02)
    # 1 %: warping and ovalling are held at the rigid end rings; the rest is thin-wall theory on both sides.
    np.testing.assert_allclose(shell, line, rtol=0.01)


@pytest.mark.parametrize(
    "casing",
    # Four times the nodes of the finer meshes that openings ask for take seconds.
    [pytest.param(c, id=c.beam.name, marks=[pytest.mark.slow] if c.openings else []) for c in CASINGS],
)
def test_bundled_links_are_within_two_percent_of_half_the_size(casing: Casing) -> None:
    shell, fine = (shell_superelement(casing.mesh(n), casing.beam.interface_points) for n in (1, 2))
    scale = np.sqrt(np.outer(np.diag(fine.flexibility), np.diag(fine.flexibility)))
    # 2 %: discretisation, as the casing's default size promises.
    assert (np.abs(shell.flexibility - fine.flexibility) / scale).max() < 0.02


def test_a_section_that_turns_at_a_kink_is_refused() -> None:
    description = load_description("kr60-3")
    robot = robot_from(description)
    forearm = next(link for link in description.link if link.name == "forearm")
    along_the_first_run = link_beam_mesh(description, robot, forearm.model_copy(update={"beam_up": (1.0, 0.0, 0.0)}))
    refuses("L009", "beam_up", casing_mesh, along_the_first_run)


def test_a_casing_twice_as_thick_is_half_as_flexible_in_membrane_directions() -> None:
    thin = _straight("tube", [0.3, 0.004])
    # Same mid-surface: the outer diameter grows by the wall's growth.
    thick = replace(thin, dimensions=np.tile(np.array([0.304, 0.008]), (4, 2, 1)))
    a, b = (np.diag(shell_superelement(casing_mesh(m), m.interface_points).flexibility) for m in (thin, thick))
    # 1 %: wall bending is not proportional to thickness, but a tube carries these loads as a membrane.
    np.testing.assert_allclose(a / b, 2.0, rtol=0.01)
