"""Points that lead their rings: a change of variables, rings on several bodies, and memory."""

from __future__ import annotations

import tracemalloc
from dataclasses import replace

import numpy as np
import pytest
import scipy.sparse as sp
from refusals import refuses

from fem.elements.condensation import condense
from fem.elements.couplings import Coupling, distributing_coupling, led_by, rigid_motion, ring_weights
from fem.elements.shell import CoupledShell, couple, shell_superelement
from meshes.shell_mesh import ShellMesh
from robots.arrays import Array

SIDE, LENGTH, WALL = 0.2, 0.5, 0.006
ENDS = np.array([[0.0, 0.0, 0.0], [LENGTH, 0.0, 0.0]])
# Round-off of two factorisations: 2e-16 times a condition of 1e5; distributing rings add their soft modes: 4e-11.
ROUND_OFF = 1e-9


def tube(n: int, along: int, *, name: str = "tube") -> ShellMesh:
    """Square tube of quads along x, n elements a wall, rings at both ends."""
    s = np.linspace(0.0, 1.0, n, endpoint=False)[:, None]
    corners = 0.5 * SIDE * np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]])
    outline = np.concatenate([corners[i] + (corners[(i + 1) % 4] - corners[i]) * s for i in range(4)])
    around = len(outline)
    x = np.repeat(np.linspace(0.0, LENGTH, along + 1), around)
    nodes = np.column_stack([x, np.tile(outline, (along + 1, 1))])
    number = np.arange(len(nodes)).reshape(along + 1, around)
    turned = np.roll(number, -1, axis=1)
    quads = np.stack([number[:-1], turned[:-1], turned[1:], number[1:]], axis=-1).reshape(-1, 4)
    rings = {"root": number[0], "tip": number[-1]}
    return ShellMesh(name, nodes, np.zeros((0, 3), np.int64), quads, np.full(len(quads), WALL), 7e10, 0.3, rings)


def forked(n: int = 3, along: int = 8) -> tuple[ShellMesh, Array]:
    """Two tubes at right angles that share nothing but their root interface."""
    one = tube(n, along)
    R = np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
    k = len(one.nodes)
    mesh = replace(
        one,
        nodes=np.vstack([one.nodes, one.nodes @ R.T]),
        quads=np.vstack([one.quads, one.quads + k]),
        thickness=np.tile(one.thickness, 2),
        interfaces={
            "root": np.concatenate([one.interfaces["root"], k + one.interfaces["root"]]),
            "tip": one.interfaces["tip"],
            "pin": k + one.interfaces["tip"],
        },
    )
    return mesh, np.vstack([ENDS, ENDS[1:] @ R.T])


def by_elimination(shell: CoupledShell) -> Array:
    """Flexibility with the points as freedoms: the plain condensation, which knows no readings."""
    S = shell.led_by_points()
    i = len(shell.points)
    points_first = np.roll(np.arange(S.shape[1]), 6 * i)
    K = sp.csc_array(S.T @ shell.stiffness @ S)[points_first][:, points_first]
    return condense("plain", ("root",) * i, shell.points, K, np.arange(i)).flexibility


def difference(a: Array, b: Array) -> float:
    scale = np.sqrt(np.diag(b))
    return float(np.abs((a - b) / np.outer(scale, scale)).max())


KINDS: list[Coupling | dict[str, Coupling]] = [
    "rigid",
    "distributing",
    {"root": "rigid", "tip": "distributing"},
    {"root": "distributing", "tip": "rigid"},
]


@pytest.mark.parametrize("kind", KINDS, ids=str)
def test_points_as_freedoms_give_the_same_flexibility(kind: Coupling | dict[str, Coupling]) -> None:
    # A point half a metre off its ring's middle, so that displacement and rotation mix.
    points = ENDS + np.array([[0.0, 0.0, 0.0], [0.1, 0.5, -0.2]])
    shell = couple(tube(4, 10), points, kind)
    assert difference(by_elimination(shell), shell.modes()[1]) < ROUND_OFF


def test_the_last_freedoms_are_the_points(rng: np.random.Generator) -> None:
    shell = couple(tube(4, 10), ENDS, "distributing")
    S = shell.led_by_points()
    assert S.shape == shell.stiffness.shape
    y = rng.normal(size=S.shape[1])
    # Round-off of a mean over 32 freedoms of size one, some of them 32 times larger.
    np.testing.assert_allclose(shell.reading @ (S @ y), y[-12:], rtol=0, atol=1e-12)
    # Freedoms that stay are themselves, in their order.
    kept = np.flatnonzero(np.diff(sp.csr_array(S).indptr) == 1)
    np.testing.assert_array_equal((S @ y)[kept], y[: kept.size])
    assert kept.size == S.shape[1] - 12


def test_rigid_rings_lead_already() -> None:
    shell = couple(tube(4, 10), ENDS, "rigid")
    assert (shell.led_by_points() != sp.eye_array(shell.stiffness.shape[0])).nnz == 0


def test_a_distributing_ring_across_a_rigid_one() -> None:
    mesh = tube(4, 10)
    # One wall near the tube's end: a third of its nodes belong to the rigid tip ring, too.
    patch = (mesh.interfaces["tip"][:5] - [[0], [16], [32]]).ravel()
    mesh = replace(mesh, interfaces={**mesh.interfaces, "pin": patch})
    points = np.vstack([ENDS, mesh.nodes[patch].mean(axis=0)])
    shell = couple(mesh, points, {"root": "rigid", "tip": "rigid", "pin": "distributing"})
    assert difference(by_elimination(shell), shell.modes()[1]) < ROUND_OFF


def test_points_that_cannot_move_apart_are_refused() -> None:
    mesh = tube(4, 10)
    mesh = replace(mesh, interfaces={**mesh.interfaces, "pin": mesh.interfaces["tip"].copy()})
    refuses("L006", "cannot move apart", shell_superelement, mesh, ENDS[[0, 1, 1]], "distributing")
    inside = replace(mesh, interfaces={**mesh.interfaces, "pin": mesh.interfaces["tip"][:9]})
    refuses(
        "L006",
        "cannot move apart",
        shell_superelement,
        inside,
        ENDS[[0, 1, 1]],
        {"root": "rigid", "tip": "rigid", "pin": "distributing"},
    )


# Rings on several bodies


@pytest.mark.parametrize("root", ["rigid", "distributing"])
def test_two_tubes_on_one_root_bend_each_by_itself(root: Coupling) -> None:
    mesh, points = forked()
    kinds: dict[str, Coupling] = {"root": root, "tip": "distributing", "pin": "rigid"}
    shell = couple(mesh, points, kinds)
    flexibility = shell.modes()[1]
    alone = shell_superelement(tube(3, 8), ENDS, {"root": root, "tip": "distributing"}).flexibility
    assert difference(flexibility[:6, :6], alone) < ROUND_OFF
    scale = np.sqrt(np.diag(flexibility))
    assert np.abs(flexibility[:6, 6:] / np.outer(scale[:6], scale[6:])).max() < ROUND_OFF
    assert difference(by_elimination(shell), flexibility) < ROUND_OFF


def test_each_part_of_a_ring_follows_its_point() -> None:
    mesh, points = forked()
    shell = couple(mesh, points, "distributing")
    shapes, _ = shell.modes()
    half = np.split(mesh.interfaces["root"], 2)
    for part in half:
        mean = distributing_coupling(mesh.nodes, part, points[0], ring_weights(mesh, part))
        moved = mean @ shapes.reshape(-1, 6, shapes.shape[1])[part].reshape(-1, shapes.shape[1])
        # The root point is at rest: round-off of the nodes' displacements.
        assert np.abs(moved).max() < ROUND_OFF * np.abs(shapes).max()


def test_bodies_that_no_ring_joins_are_refused() -> None:
    mesh, points = forked()
    apart = replace(mesh, interfaces={**mesh.interfaces, "root": mesh.interfaces["root"][:12]})
    for kind in ("rigid", "distributing"):
        refuses("L007", r"2 separate bodies of \[108, 108\] nodes", couple, apart, points, kind)


# The change of variables by itself


def test_led_by_on_two_sets_that_overlap(rng: np.random.Generator) -> None:
    M = np.zeros((12, 40))
    M[:6, :22], M[6:, 18:] = rng.normal(size=(6, 22)), rng.normal(size=(6, 22))
    follows = rng.normal(size=(12, 7))
    S = led_by(sp.csc_array(M), follows)
    assert S.shape == (40, 35)
    y = rng.normal(size=35)
    np.testing.assert_allclose(M @ (S @ y), follows @ y[-7:], rtol=0, atol=1e-10)  # random 12 x 12 blocks: 1e-13


# Memory


def _peak_bytes(mesh: ShellMesh, kind: Coupling) -> float:
    """Most memory at once for a superelement, per freedom. What SciPy's factorisation takes is not seen."""
    shell_superelement(mesh, ENDS, kind)  # what is loaded and kept at the first call does not count
    tracemalloc.start()
    try:
        shell_superelement(mesh, ENDS, kind)
        return tracemalloc.get_traced_memory()[1] / (6 * len(mesh.nodes))
    finally:
        tracemalloc.stop()


@pytest.mark.parametrize(
    ("kind", "interface"), [("rigid", "ring"), ("distributing", "ring"), ("distributing", "patch")]
)
def test_memory_of_a_superelement_grows_with_the_mesh_only(kind: Coupling, interface: str) -> None:
    meshes = [tube(3, 8), tube(6, 16)]
    if interface == "patch":
        # A third of all nodes in one interface, as where a closed flange is held.
        patches = [np.flatnonzero(m.nodes[:, 0] > 0.66 * LENGTH) for m in meshes]
        meshes = [replace(m, interfaces={**m.interfaces, "tip": p}) for m, p in zip(meshes, patches, strict=True)]
    small, large = (_peak_bytes(m, kind) for m in meshes)
    # Four times the nodes. The ends have a smaller share of the larger mesh: 5 % more a freedom was measured. With
    # the points as freedoms here, too, the patch's full block would make it 59 %.
    assert large < 1.15 * small


def test_memory_of_leading_points_grows_with_the_mesh_only() -> None:
    entries = []
    for mesh in (tube(4, 10), tube(8, 20)):
        shell = couple(mesh, ENDS, "distributing")
        S = shell.led_by_points()
        entries.append((S.T @ shell.stiffness @ S).nnz / S.shape[0])
    # The full block of a ring has (3r)^2 entries and r grows with the square root of the mesh.
    assert entries[1] < 1.25 * entries[0]


def test_motion_of_a_whole_body_strains_nothing() -> None:
    shell = couple(*forked(2, 3), "distributing")
    rigid = rigid_motion(shell.nodes).reshape(-1, 6)
    # The reduced freedoms of a rigid motion, by least squares; the expansion of those is the motion again.
    T = shell.expansion.toarray()
    x = np.linalg.lstsq(T, rigid, rcond=None)[0]
    np.testing.assert_allclose(T @ x, rigid, rtol=0, atol=1e-10)  # round-off of a dense least squares
    force = np.abs(shell.stiffness @ x).max()
    assert force < ROUND_OFF * np.abs(shell.stiffness).max()
