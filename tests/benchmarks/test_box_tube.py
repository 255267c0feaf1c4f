"""A square tube with rigid end rings against Timoshenko's beam, and what folds do to triangles in its torsion."""

from __future__ import annotations

from functools import cache
from pathlib import Path

import numpy as np
import pytest
import scipy.sparse as sp
from shell_problems import Shape

from fem.elements import couplings
from fem.elements.assembly import assemble_shell
from fem.elements.condensation import solve_positive_definite
from fem.elements.couplings import rigid_motion
from fem.elements.shell import shell_superelement
from meshes import section_properties
from meshes.shell_mesh import ShellMesh

TABLES = Path(__file__).resolve().parents[2] / "docs" / "validation" / "shell_convergence_triangle.md"
E, NU = 210e9, 0.3
SIDE, LENGTH, WALL = 0.3, 1.0, 0.008
DIRECTIONS = ("axial", "transverse", "transverse", "torsion", "bending moment", "bending moment")


def tube(shape: Shape, n: int, m: int, length: float) -> ShellMesh:
    """Square tube along x, n elements a wall and m along, outer side SIDE, rings at both ends."""
    s = np.arange(n)[:, None] / n
    corners = 0.5 * (SIDE - WALL) * np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]])
    outline = np.concatenate([corners[i] + (corners[(i + 1) % 4] - corners[i]) * s for i in range(4)])
    x = np.repeat(np.linspace(0.0, length, m + 1), len(outline))
    nodes = np.column_stack([x, np.tile(outline, (m + 1, 1))])
    number = np.arange(len(nodes)).reshape(m + 1, -1)
    turned = np.roll(number, -1, axis=1)
    quads = np.stack([number[:-1], turned[:-1], turned[1:], number[1:]], axis=-1).reshape(-1, 4)
    triangles = np.concatenate([quads[:, [0, 1, 2]], quads[:, [0, 2, 3]]])
    cells = (triangles, quads[:0]) if shape == "tri" else (triangles[:0], quads)
    walls = np.full(sum(map(len, cells)), WALL)
    return ShellMesh("tube", nodes, *cells, walls, E, NU, {"root": number[0], "tip": number[-1]})


@cache
def beam_ratios(shape: Shape, n: int) -> dict[str, float]:
    """Flexibility over the beam's by direction; elements as square as they can be."""
    mesh = tube(shape, n, round(n * LENGTH / (SIDE - WALL)), LENGTH)
    found = np.diag(shell_superelement(mesh, np.array([[0.0, 0.0, 0.0], [LENGTH, 0.0, 0.0]])).flexibility)
    p = section_properties("box", np.array([SIDE, SIDE, WALL]), NU)
    G, L = E / (2.0 * (1.0 + NU)), LENGTH
    bending = L**3 / (3 * E * p.iyy) + L / (G * p.shear_z)
    beam = [L / (E * p.area), bending, bending, L / (G * p.torsion), L / (E * p.iyy), L / (E * p.iyy)]
    return {name: float(ratio) for name, ratio in zip(DIRECTIONS, found / beam, strict=True)}


@cache
def endless_ratio(shape: Shape, n: int) -> float:
    """Torsional flexibility over Bredt's of a tube without ends: one row of square elements that repeats itself."""
    row = (SIDE - WALL) / n
    mesh = tube(shape, n, 1, row)
    around = 6 * len(mesh.interfaces["root"])
    # The second ring moves as the first, turned about x by a unit twist a length.
    same = sp.vstack([sp.eye_array(around)] * 2).tocsc()
    twist = np.zeros(2 * around)
    twist[around:] = row * rigid_motion(mesh.nodes[mesh.interfaces["tip"]])[:, :, 3].ravel()
    K = assemble_shell(mesh)
    reduced = sp.csc_array(same.T @ K @ same)
    # Motions without strain: three displacements, and a turn about x by one more at the opposite fold.
    free = np.setdiff1d(np.arange(around), [0, 1, 2, 6 * (2 * n) + 1])
    u = twist.copy()
    u += same[:, free] @ solve_positive_definite(reduced[free][:, free], -(same.T @ (K @ u))[free][:, None])[:, 0]
    side = SIDE - WALL
    bredt = E / (2.0 * (1.0 + NU)) * (side**3 * WALL + 4.0 * side * WALL**3 / 3.0)
    return float(bredt / (u @ (K @ u) / row))


def _rows(heading: str) -> dict[str, dict[tuple[Shape, int], float]]:
    """Ratios by kind and n of the rows of the table whose first cell is ``heading``."""
    rows: dict[str, dict[tuple[Shape, int], float]] = {}
    columns: list[tuple[Shape, int]] = []
    for line in TABLES.read_text(encoding="utf-8").splitlines():
        cells = [cell.strip() for cell in line.strip("|").split("|")]
        if len(cells) < 2 or not line.startswith("|"):
            columns = []
        elif cells[0] == heading:
            shape: Shape = "tri"
            for cell in cells[1:]:
                shape = "quad" if "quads" in cell else shape
                columns.append((shape, int(cell.split()[-1])))
        elif columns and not cells[0].startswith("-"):
            rows[cells[0]] = dict(zip(columns, map(float, cells[1:]), strict=True))
    return rows


PRINTED, ENDLESS = _rows("direction"), _rows("endless tube")["torsion"]
COLUMNS = list(PRINTED["torsion"])
# Three digits are printed: half of the last one, and round-off.
PRINTED_TO = 5.1e-4


@pytest.mark.parametrize("column", [pytest.param(c, marks=[pytest.mark.slow] if c[1] > 16 else []) for c in COLUMNS])
def test_the_printed_table_is_what_comes_out(column: tuple[Shape, int]) -> None:
    for direction, ratio in beam_ratios(*column).items():
        assert ratio == pytest.approx(PRINTED[direction][column], abs=PRINTED_TO), direction


@pytest.mark.parametrize("shape", ["tri", "quad"])
def test_all_directions_are_within_one_percent(shape: Shape) -> None:
    # The brief's 1 %; 0.6 to 0.8 % is what rigid rings hold and the beam does not know.
    assert list(beam_ratios(shape, 16).values()) == pytest.approx([1.0] * 4, abs=0.01)


def test_an_endless_tube_is_bredts_but_for_its_folds() -> None:
    found = {column: endless_ratio(*column) for column in ENDLESS}
    assert found == pytest.approx(ENDLESS, abs=5.1e-5)
    quads = np.array([found[column] for column in found if column[0] == "quad"])
    triangles = np.array([found[column] for column in found if column[0] == "tri"])
    # Quads: an error that halves with the elements.
    assert np.log2((1.0 - quads[:-1]) / (1.0 - quads[1:])) == pytest.approx(1.0, abs=0.2)
    # Triangles: most where the elements are as large as the wall is thick (n = 36), then less again.
    worst = int(np.argmin(triangles))
    assert 0 < worst < len(triangles) - 1
    assert triangles.min() > 0.993


def test_a_ring_that_holds_drilling_fails(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(couplings, "SMOOTH", 2.0)
    # 0.967 instead of 0.990: the triangles at the rings cannot shear.
    assert beam_ratios.__wrapped__("tri", 4)["torsion"] < 0.975
