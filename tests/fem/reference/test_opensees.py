"""A link condensed by us and by OpenSees on the same mesh: every entry of the flexibility, both interfaces."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import oracles
import pytest
from opensees_shell import run_opensees

import fem
from fem.elements.assembly import freedoms
from fem.elements.shell import shell_superelement
from meshes.casings import casing_mesh
from meshes.shell_mesh import ShellMesh
from robots import load_description
from robots.arrays import Array

pytestmark = pytest.mark.oracle
oracles.load_apart("openseespy.opensees")


def forearm(size: float, shape: str) -> tuple[ShellMesh, Array]:
    """Casing of the xr701's forearm and its three interface points: elbow, wrist and the parallelogram's pin."""
    model = fem.build_model(load_description("xr701"), "beam")
    beam = next(link.mesh for link in model.links if link.name == "forearm")
    mesh = casing_mesh(beam, size)
    if shape == "tri":
        q = mesh.quads
        halves = np.concatenate([q[:, [0, 1, 2]], q[:, [0, 2, 3]]])
        mesh = replace(mesh, triangles=halves, quads=q[:0], thickness=np.tile(mesh.thickness, 2))
    return mesh, beam.interface_points


def opensees_flexibility(mesh: ShellMesh, points: Array, element: str) -> Array:
    """Motion (12, 12) of the other interfaces under unit wrenches there, the root's ring held."""
    root, *rings = mesh.interfaces.values()
    first, n = 6 * len(mesh.nodes), 6 * len(rings)
    loads = np.zeros((n, first + n))
    loads[:, first:] = np.eye(n)
    run = run_opensees(mesh, element, freedoms(root).ravel(), loads, points[1:], rings)
    return run.displacements.reshape(n, -1)[:, first:]


def largest_difference(size: float, shape: str, element: str) -> float:
    """Of all entries, relative to the geometric mean of their diagonals, so that small ones count by what they do."""
    mesh, points = forearm(size, shape)
    ours = shell_superelement(mesh, points).flexibility
    theirs = opensees_flexibility(mesh, points, element)
    assert ours.shape == (12, 12)
    scale = np.sqrt(np.diag(ours))
    return float(np.abs((theirs - ours) / np.outer(scale, scale)).max())


@pytest.mark.parametrize(
    ("size", "shape", "element"),
    [(0.08, "quad", "ASDShellQ4"), pytest.param(0.06, "tri", "ShellDKGT", marks=pytest.mark.slow)],
)
def test_flexibility_of_the_forearm_is_openseess(size: float, shape: str, element: str) -> None:
    # The brief's 1 %; measured 0.3 % at 2200 freedoms and 0.5 % at 4300.
    assert largest_difference(size, shape, element) < 0.01


@pytest.mark.slow
@pytest.mark.parametrize(
    ("size", "shape", "element"),
    [(0.03, "quad", "ASDShellQ4"), (0.02, "quad", "ShellMITC4"), (0.03, "tri", "ShellDKGT")],
)
def test_all_elements_agree_on_fine_meshes(size: float, shape: str, element: str) -> None:
    # 0.05, 0.9 and 0.4 % (docs/validation/shell_convergence_opensees.md);
    # ShellMITC4's comes down with the element size.
    assert largest_difference(size, shape, element) < 0.01


@pytest.mark.slow
def test_a_wall_one_twentieth_thicker_is_noticed() -> None:
    mesh, points = forearm(0.06, "quad")
    ours = shell_superelement(replace(mesh, thickness=1.05 * mesh.thickness), points).flexibility
    theirs = opensees_flexibility(mesh, points, "ASDShellQ4")
    scale = np.sqrt(np.diag(ours))
    assert np.abs((theirs - ours) / np.outer(scale, scale)).max() > 0.04
