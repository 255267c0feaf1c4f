"""Sparse assembly of shells against adding element by element, and work in batches against all at once."""

from __future__ import annotations

import numpy as np
import pytest

from fem.elements import facets
from fem.elements.assembly import assemble_shell, element_stiffness, freedoms
from meshes.shell_mesh import ShellMesh


def sheet(kind: str, rng: np.random.Generator, n: int = 4) -> ShellMesh:
    """A wavy sheet of n x n cells, nodes numbered at random, walls of many thicknesses."""
    x, y = (a.ravel() for a in np.meshgrid(np.arange(n + 1.0), np.arange(n + 1.0), indexing="ij"))
    number = rng.permutation(x.size).reshape(n + 1, n + 1)
    nodes = np.empty((x.size, 3))
    nodes[number.ravel()] = np.stack([x, y, 0.2 * np.sin(x + 0.7 * y)], axis=1)
    cells = np.stack([number[:-1, :-1], number[1:, :-1], number[1:, 1:], number[:-1, 1:]], axis=-1).reshape(-1, 4)
    cut = {"quad": 0, "mixed": len(cells) // 2, "tri": len(cells)}[kind]
    triangles = np.concatenate([cells[:cut, [0, 1, 2]], cells[:cut, [0, 2, 3]]])
    walls = rng.uniform(0.05, 0.1, len(triangles) + len(cells) - cut)
    return ShellMesh("sheet", nodes, triangles, cells[cut:], walls, 1e6, 0.3, {})


@pytest.mark.parametrize("kind", ["quad", "tri", "mixed"])
def test_sparse_assembly_adds_every_element_in_its_place(kind: str, rng: np.random.Generator) -> None:
    mesh = sheet(kind, rng)
    expected = np.zeros((6 * len(mesh.nodes),) * 2)
    for elements, matrices in zip((mesh.triangles, mesh.quads), element_stiffness(mesh), strict=True):
        for nodes, K in zip(elements, matrices, strict=True):
            dofs = freedoms(nodes).ravel()
            expected[np.ix_(dofs, dofs)] += K
    found = assemble_shell(mesh)
    assert found.has_canonical_format
    # Round-off of sums of up to eight terms, in another order.
    np.testing.assert_allclose(found.toarray(), expected, rtol=0, atol=1e-14 * np.abs(expected).max())


def test_batches_do_not_show(monkeypatch: pytest.MonkeyPatch, rng: np.random.Generator) -> None:
    mesh = sheet("mixed", rng)
    whole = element_stiffness(mesh)
    monkeypatch.setattr(facets, "BATCH", 3)
    # The kernels may group their sums by the number of elements: round-off.
    for one, other in zip(whole, element_stiffness(mesh), strict=True):
        np.testing.assert_allclose(other, one, rtol=0, atol=1e-14 * np.abs(one).max())
